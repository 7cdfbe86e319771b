"""An investigation on the independent rig: its recordings, and what is counted of it."""

from dataclasses import replace

import numpy as np
import pytest

from model_discrepancy.tools.candidate_movements import LEVELS, Candidate
from simulation_study.independent_conduct import IndependentConduct
from simulation_study.investigations import names_in_the_end, outcome, report
from simulation_study.verdict_cases import plans, trial_of

STEPS = Candidate("steps", {"signal": "random_steps", "amplitude": 0.02, "direction": "both"})


@pytest.mark.parametrize(
    ("left", "became"),
    [
        (["tendon"], "right"),
        (["tendon", "fractional_damping"], "right"),
        (["backlash"], "wrong"),
        (["tendon", "backlash"], "open"),
    ],
)
def test_a_set_is_right_where_only_right_names_are_left(left, became):
    names = ["tendon", "fractional_damping", "backlash"]
    assert outcome(names, left, ["tendon", "fractional_damping"]) == became
    assert outcome(["backlash"], ["backlash"], ["tendon"]).startswith("wrong, as it was")
    assert outcome(["backlash"], ["tendon"], ["tendon"]) == "right"
    assert outcome(["backlash"], [], ["tendon"]) == "withdrawn"
    assert outcome(["backlash", "tendon"], [], ["tendon"]) == "wrong"


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ([], "none"),
        (["tendon/fractional_damping"], "right"),
        (["tendon", "backlash"], "both"),
        (["tendon/backlash"], "both"),
        (["backlash"], "wrong"),
    ],
)
def test_an_investigation_is_right_where_all_its_names_are(names, said):
    entry = {"names": names, "right": ["tendon", "fractional_damping"]}
    assert names_in_the_end(entry) == said


def test_the_report_counts_sets_and_not_recordings():
    entry = {
        "case": "effect-000-tendon",
        "hidden": "tendon",
        "protocol": "pulse_step",
        "share": 0.02,
        "right": ["tendon"],
        "sets": [["backlash", "tendon"], ["viscosity", "inertia"]],
        "left": [["tendon"], ["viscosity"]],
        "names": ["tendon", "viscosity"],
        "recordings": ["steps"],
    }
    closed = {**entry, "sets": [], "left": []}
    beside = {**entry, "sets": [["viscosity"]], "left": [[]], "names": ["tendon"]}
    text = report([entry, closed, beside], "command")
    assert "recordings that left a set open | 2 |" in text
    assert "| only right names are left of all their effects | 1 of 2" in text
    assert "| right and wrong names are left | 1 of 2" in text
    text = report([entry, closed], "command")
    assert "2 recordings" in text
    assert "first recording left open | 2 |" in text
    assert "the right name was in it | 1 of 2" in text
    assert "| only right names are left in the end | 1 of 2" in text
    assert "| of the sets that held the right name: only right names are left | 1 of 1" in text
    assert "| every name was right from the first | 0 of 2" in text


def test_a_round_records_the_designed_movement_of_the_same_subject():
    (plan,) = plans({"effect": 1}, 5)
    plan = replace(plan, rate=1000.0, velocity=True, reference=True, servo="stiff")
    trial, _ = trial_of(plan)
    conduct = IndependentConduct(plan, trial)
    first = conduct(STEPS, 15.0, 1)
    again, other = conduct(STEPS, 15.0, 1), conduct(STEPS, 15.0, 2)
    np.testing.assert_array_equal(first.torque, again.torque)
    assert not np.array_equal(first.torque, other.torque)
    np.testing.assert_allclose(first.reference, STEPS.reference(15.0, 1000.0)[:, 0], atol=1e-3)
    moved = first.position - first.position.mean()
    assert np.corrcoef(moved, first.reference)[0, 1] > 0.95
    levels = conduct(replace(STEPS, levels=True), 15.0, 1).torque.reshape(3, -1).mean(axis=1)
    np.testing.assert_allclose(np.diff(levels), np.diff(LEVELS), atol=1.5)
