"""Refusals of a quantity, and settings whose fields are quantities."""

import dataclasses

import numpy as np
import pytest

from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Quantity, check_settings, choice, number, quantities

STIFFNESS = Quantity("K", "N.m/rad", 0.0, 1000.0, 100.0)


@pytest.mark.parametrize(
    ("quantity", "value", "sentence"),
    [
        (
            STIFFNESS,
            5000.0,
            "parameter 'K' = 5000.0 N.m/rad is refused; allowed: 0 to 1000 N.m/rad",
        ),
        (
            STIFFNESS,
            np.float64(-1),
            "parameter 'K' = -1.0 N.m/rad is refused; allowed: 0 to 1000 N.m/rad",
        ),
        (STIFFNESS, True, "parameter 'K' = True N.m/rad is refused; allowed: 0 to 1000 N.m/rad"),
        (
            STIFFNESS,
            float("nan"),
            "parameter 'K' = nan N.m/rad is refused; allowed: 0 to 1000 N.m/rad",
        ),
        (STIFFNESS, "stiff", "parameter 'K' = 'stiff' is refused; allowed: 0 to 1000 N.m/rad"),
        (
            Quantity("order", "1", 1, 8, 2),
            1.5,
            "parameter 'order' = 1.5 is refused; allowed: whole number 1 to 8",
        ),
        (
            Quantity("shape", default="block", choices=("block", "step")),
            "saw",
            "parameter 'shape' = 'saw' is refused; allowed: one of block, step",
        ),
        (
            Quantity("noise", default=True),
            1,
            "parameter 'noise' = 1 is refused; allowed: true or false",
        ),
    ],
)
def test_a_refusal_names_value_unit_and_range(quantity, value, sentence):
    with pytest.raises(QuantityError) as refused:
        quantity.check(value)
    assert str(refused.value).startswith(sentence)


def test_an_accepted_value_has_the_type_of_the_quantity():
    assert isinstance(STIFFNESS.check(2), float)
    assert isinstance(Quantity("n", "1", 0, 9, 1).check(np.int64(3)), int)
    assert Quantity("noise", default=False).check(True) is True
    assert Quantity("title", default="").check("anything") == "anything"


@dataclasses.dataclass(frozen=True)
class Settings:
    memory: float = number(20.0, "s", 1.0, 60.0, "A third of a hold.")
    detection: str = choice("on", ("on", "off"), "Forgets what was before a change.")
    note: str = ""

    def __post_init__(self):
        check_settings(self)


def test_settings_are_quantities_named_by_their_fields():
    declared = quantities(Settings)
    assert list(declared) == ["memory", "detection"]
    assert declared["memory"] == Quantity("memory", "s", 1.0, 60.0, 20.0, "A third of a hold.")
    assert Settings(memory=30).memory == 30
    with pytest.raises(QuantityError, match=r"'memory' = 90\.0 s is refused; allowed: 1 to 60 s"):
        Settings(memory=90.0)
    with pytest.raises(QuantityError, match="'detection' = 'maybe' is refused"):
        Settings(detection="maybe")


def test_an_explanation_is_in_sentences():
    stated = Quantity("K", source="twice the largest measured", description="Stiffness")
    assert stated.explanation == "Stiffness. Source: Twice the largest measured."
    assert Quantity("K", source="twice the largest measured").explanation.startswith("Twice")
    assert Quantity("K").explanation == ""
