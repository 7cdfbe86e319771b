"""A family that is left out of the library is named in no other way."""

import pytest

from model_discrepancy.diagnose import diagnose
from simulation_study.verdict_cases import Plan, made
from simulation_study.verdict_study import library_of


@pytest.mark.slow
def test_a_skew_is_not_named_by_way_of_the_alignment_of_the_channels():
    plan = Plan(
        "left_out", 10, 1638069290601558823, ("torque_delay",), "stiff", "equal_steps", 1000.0,
        True, False, "quiet", "large", True,
    )  # fmt: skip
    library = library_of(plan)
    assert "channel_skew" not in library
    found = diagnose(made(plan).recording, library=library).verdict
    assert "channel_skew" not in {effect["name"] for effect in found.effects}
