"""The table of a fault campaign counts cases, and counts every case that breaks its promise."""

import math

import pytest
from fault_campaign import FAULTS
from fault_table import KEPT_STATES, Case, Outcome, verdict, write_section

GOOD = {"state": "fault", "rest": 0.1, "again": 0.3, "lost": 5, "reported": 5}


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"state": "running", "reason": "as before"}, "the driver was running: as before"),
        ({"again": math.nan}, "did not run again"),
        ({"lost": 6}, "6 samples were lost, 5 were reported"),
        ({"reported": 7}, "5 samples were lost, 7 were reported"),
        ({"beyond": True}, "passed a limit"),
        ({"problems": ["the drive was not off"]}, "the drive was not off"),
    ],
)
def test_a_case_that_breaks_its_promise_is_counted_once(change, sentence):
    outcomes = [
        Outcome("first", "faults", [Case(**GOOD), Case(**{**GOOD, **change}), Case(**GOOD)]),
        Outcome("second", "faults", [Case(**GOOD)]),
    ]
    (broken,) = outcomes[0].broken()
    assert broken.startswith("first: ")
    assert sentence in broken
    assert "3 of 4" in verdict(outcomes)


def test_two_broken_cases_of_one_fault_are_two_and_two_breaks_of_one_case_are_one():
    bad = Case("running", lost=3)
    assert "1 of 3" in verdict([Outcome("one", "faults", [Case(**GOOD), bad, bad])])
    assert "all of 2" in verdict([Outcome("one", "faults", [Case(**GOOD), Case(**GOOD)])])


def test_a_row_shows_the_slowest_rest_and_sums_of_samples():
    row = Outcome("one", "faults", [Case(**GOOD), Case(**{**GOOD, "rest": 0.25})]).row()
    assert row == "| one | faults | fault 2 | 0 | 10 | 10 | 250 | 0.30 |"


def test_every_fault_of_the_campaign_has_a_name_of_its_own_and_a_known_promise():
    names = [fault.name for fault in FAULTS]
    assert len(names) == len(set(names)) >= 150
    assert {fault.promise for fault in FAULTS} <= {*KEPT_STATES, "any"}


def test_a_section_takes_the_place_of_the_one_with_its_title(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# Page\n\n## One\n\nold\n\n## Two\n\nstays\n")
    write_section(page, "One", "new\n")
    write_section(page, "Three", "added")
    assert page.read_text() == ("# Page\n\n## One\n\nnew\n\n## Two\n\nstays\n\n## Three\n\nadded\n")
