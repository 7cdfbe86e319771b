"""The torque that the muscles hold, where the joint's stiffness follows it, on the independent
rig.
"""

from dataclasses import replace

import numpy as np
import pytest

from blind_rig.trial import run
from model_discrepancy.diagnose import diagnose
from model_discrepancy.fit.held_torque import following
from model_discrepancy.problem import prepare, with_better_course
from simulation_study import verdict_cases
from simulation_study.verdict_cases import plans, recorded, trial_of

FOLLOWS = "stiffness_follows_torque"
COUNTS = {"effect": 54, "pair": 60}
SEED = 24754327


def _made(kind, number, hidden):
    """Return a recording of the independent rig with these effects, in the subject and the movement
    of a case, and the torque that its muscles held.
    """
    plan = next(p for p in plans(COUNTS, SEED) if (p.kind, p.number) == (kind, number))
    plan = replace(plan, hidden=hidden)
    trial, _ = trial_of(plan)
    done = run(trial)
    return recorded(plan, trial, done), done


def _correlation(course, done, rate):
    time = np.arange(len(course)) / rate
    true = np.interp(time, np.arange(len(done.course.steady)) / done.rate, done.course.steady)
    return np.corrcoef(course, true)[0, 1]


@pytest.mark.slow
def test_the_course_of_a_stiffness_that_follows_torque_is_found_on_the_independent_rig(monkeypatch):
    # [s] Enough for a course below 0.7 Hz; the search for the effect's size runs the trial often.
    monkeypatch.setattr(verdict_cases, "DURATION_S", 25.0)
    recording, done = _made("effect", 37, (FOLLOWS,))
    problem = prepare(recording)
    motion = problem.fitter.motion
    plain = problem.fitter.rows.slow(problem.base.left, 0.7)
    assert _correlation(motion.activation, done, motion.rate) > 0.7
    assert _correlation(plain, done, motion.rate) < 0.5
    # Another round finds no better one.
    _, gain = following(problem.fitter, problem.base)
    assert gain == pytest.approx(0.0, abs=1e-6)
    assert with_better_course(problem, problem.base) is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "number", "hidden", "names"),
    [
        ("effect", 37, (FOLLOWS,), {"activation_stiffness"}),
        # Torque that lags makes slow torque of its own, until it is found.
        ("pair", 27, ("torque_lag", FOLLOWS), {"activation_stiffness", "torque_sensor_lag"}),
    ],
)
def test_a_stiffness_that_follows_torque_is_named_on_the_independent_rig(
    kind, number, hidden, names
):
    found = diagnose(_made(kind, number, hidden)[0])
    assert found.verdict.verdict == "explained"
    assert {effect["name"] for effect in found.verdict.effects} == names
