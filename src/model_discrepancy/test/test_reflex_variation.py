"""A reflex that changes in the course of time is seen on the independent rig, and a usual one is
not.
"""

import pytest

from model_discrepancy.criticism.variability import USUAL_REFLEX_JITTER, variability
from model_discrepancy.problem import prepare
from simulation_study.verdict_cases import Plan, made


def varies(*hidden, protocol="random_levels", variability_of_subject="large", seed=77):
    plan = Plan(
        *("foreign", 0, seed, hidden, "stiff", protocol, 1000.0),
        velocity=True,
        reference=True,
        noise="quiet",
        variability=variability_of_subject,
    )
    problem = prepare(made(plan)[0])
    return variability(problem.fitter, problem.base, problem.recording.torque)


@pytest.mark.slow
def test_the_usual_variation_of_a_reflex_is_independent_and_in_time():
    found = varies()
    assert 0.1 < found.reflex[0] < 0.4
    assert found.timing[0] < 0.4 * USUAL_REFLEX_JITTER
    assert abs(found.serial[0]) < 3.0 * found.serial[1]
    assert found.unusual == []


def test_a_delay_that_wanders_is_measured():
    found = varies("wandering_delay")
    assert found.timing[0] == pytest.approx(0.009, abs=0.004)  # rms 10 ms, within its range
    assert "earlier and later" in found.unexplainable[0]


def test_a_reflex_that_is_turned_down_in_bouts_is_seen():
    found = varies("reflex_bouts", variability_of_subject="small")
    assert found.serial[0] > 3.0 * found.serial[1]
    assert found.timing[0] < 0.4 * USUAL_REFLEX_JITTER
    assert "several stretches at a time" in found.unexplainable[0]


@pytest.mark.slow
def test_responses_that_overlap_do_not_tell_which_stretch_differs():
    found = varies(protocol="multisine")
    assert found.timing is None
    assert found.serial is None
    assert found.unusual == []
