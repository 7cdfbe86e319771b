"""Values are printed as exactly as they are known, and units as people read them."""

import math

import pytest

from ankle_interfaces.value_text import readable_unit, three_digits, with_error, with_unit


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (794.6, 163.0, "790 ± 160"),
        (0.003191, 0.00019, "0.00319 ± 0.00019"),
        (22.32, 3.04, "22.3 ± 3.0"),
        (-299.2, math.nan, "-299"),
        (20.0, math.inf, "20.0"),
        (1234.0, math.nan, "1234"),
        (math.nan, 1.0, "-"),
    ],
)
def test_a_value_and_its_error_are_rounded_to_one_place(value, error, text):
    assert with_error((value, error)) == text


def test_a_value_without_error_has_three_digits():
    assert three_digits(0.98765) == "0.988"
    assert three_digits(98765.4) == "98765"


@pytest.mark.parametrize(
    ("quantity", "text"),
    [
        ("K[N.m/rad]", "K [N·m/rad]"),
        ("kr[N.m.s/rad^2]", "kr [N·m·s/rad²]"),
        ("doubt[1]", "doubt"),
        ("mvc_torque[N.m]", "MVC torque [N·m]"),
        ("session", "session"),
    ],
)
def test_a_quantity_is_named_as_people_read_it(quantity, text):
    assert with_unit(quantity) == text


def test_a_share_has_no_unit():
    assert readable_unit("1") == ""
    assert readable_unit("kg.m^2") == "kg·m²"
