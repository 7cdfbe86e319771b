"""The torque that a calibrated model predicts on data that it was not fitted to."""

import numpy as np
import pytest
from random_motion import CORE, random_motion

from ankle_physics.model import Model
from ankle_physics.signals import Signals
from impedance_estimator.estimator import ESTIMATE_COLUMNS
from impedance_estimator.known_physics import KnownPhysics
from impedance_estimator.offline.model_prediction import LEAD, predict_with_model

RATE = 1000.0


def motion(seconds=12.0):
    return random_motion(RATE, seconds, cutoff=12.0, seed=7)


def torque_of(terms, x, v, a):
    return Model.of(terms).start(RATE).torque(Signals(RATE, x, v, a))


@pytest.mark.parametrize(
    "extra",
    [
        {"maxwell_relaxation": {"k": 60.0, "T": 0.08}, "channel_skew": {"skew": 0.003}},
        {"fixation_compliance": {"k_s": 500.0, "b_s": 1.0}},
    ],
)
def test_the_model_that_made_the_torque_predicts_it_and_the_core_alone_does_not(extra):
    x, v, a = motion()
    measured = torque_of({**CORE, **extra}, x, v, a)
    right = predict_with_model(RATE, KnownPhysics(subject=Model.of({**CORE, **extra})), x, measured)
    bare = predict_with_model(RATE, KnownPhysics(subject=Model.of(CORE)), x, measured)
    assert right.vaf > 99.9
    assert bare.vaf < 95.0


@pytest.mark.parametrize("play", ["lost_motion", "fixation_stops"])
def test_play_acts_on_the_motion_and_not_on_what_a_filter_leaves_of_it(play):
    x, v, a = random_motion(RATE, 12.0, cutoff=40.0, seed=7)
    terms = {**CORE, play: {}}
    known = KnownPhysics(subject=Model.of(terms))
    assert predict_with_model(RATE, known, x, torque_of(terms, x, v, a)).vaf > 99.7


def test_a_torque_that_comes_earlier_is_predicted_earlier():
    x, v, a = motion()
    late_position = {**CORE, "channel_skew": {"skew": -0.003}}
    signals = Signals(RATE, x, v, a)
    measured = Model.of(late_position).start(RATE).torque(signals)
    found = predict_with_model(
        RATE, KnownPhysics(subject=Model.of(late_position)), signals.measured_position, measured
    )
    assert found.vaf > 99.9


def rows_of(times, K):
    rows = np.zeros((len(times), len(ESTIMATE_COLUMNS)))
    for name, value in (
        ("t[s]", times),
        ("K[N.m/rad]", K),
        ("B[N.m.s/rad]", 0.63),
        ("I[kg.m^2]", 0.0137),
        ("G[N.m.s/rad]", 10.0),
        ("valid[1]", 1.0),
    ):
        rows[:, ESTIMATE_COLUMNS.index(name)] = value
    return rows


def test_estimates_predict_only_what_comes_after_them():
    """K doubles: rows that say so at once are right from then on, but for the time in which only
    older rows may be used.
    """
    x, v, a = motion()
    middle = len(x) // 2
    K = np.where(np.arange(len(x)) < middle, 100.0, 200.0)
    model = Model.of(CORE)
    model.entry("stiffness").values["K"] = K
    measured = model.start(RATE).torque(Signals(RATE, x, v, a))
    times = np.arange(0.0, 12.0, 1.0 / 16.0)
    rows = rows_of(times, np.where(times < middle / RATE, 100.0, 200.0))
    known = KnownPhysics(subject=Model.of(CORE))
    followed = predict_with_model(RATE, known, x, measured, rows)
    error = np.abs(followed.torque - followed.measured)
    since = followed.time - middle / RATE
    late = (since > LEAD + 0.2) | (since < -0.2)
    assert error[late].max() < 0.3
    assert error[(since > 0.0) & (since < LEAD)].max() > 1.0
    assert followed.vaf > predict_with_model(RATE, known, x, measured).vaf


def test_an_estimate_that_knows_little_or_an_inertia_that_no_foot_has_is_not_followed():
    x, v, a = motion()
    measured = torque_of(CORE, x, v, a)
    known = KnownPhysics(subject=Model.of(CORE))
    times = np.arange(0.0, 12.0, 1.0 / 16.0)
    wrong = rows_of(times, 200.0)
    assert predict_with_model(RATE, known, x, measured, wrong).vaf < 95.0
    unsure = wrong.copy()
    unsure[:, ESTIMATE_COLUMNS.index("se_K[N.m/rad]")] = 100.0
    assert predict_with_model(RATE, known, x, measured, unsure).vaf > 99.9
    heavy = rows_of(times, 100.0)
    heavy[:, ESTIMATE_COLUMNS.index("I[kg.m^2]")] *= 2.0
    assert predict_with_model(RATE, known, x, measured, heavy).vaf > 99.0


@pytest.mark.parametrize(
    ("error", "followed"), [(0.0, 1.0), (10.0, 0.75), (20.0, 0.0), (30.0, 0.0)]
)
def test_of_a_change_only_what_its_error_does_not_explain_is_followed(error, followed):
    """K is 120 instead of 100; an estimate of it follows by 1 - (error / change)^2."""
    x, v, a = motion()
    measured = torque_of({**CORE, "stiffness": {"K": 120.0}}, x, v, a)
    rows = rows_of(np.arange(0.0, 12.0, 1.0 / 16.0), 120.0)
    rows[:, ESTIMATE_COLUMNS.index("se_K[N.m/rad]")] = error
    known = KnownPhysics(subject=Model.of(CORE))
    found = predict_with_model(RATE, known, x, measured, rows)
    expected = torque_of({**CORE, "stiffness": {"K": 100.0 + 20.0 * followed}}, x, v, a)
    alike = predict_with_model(RATE, known, x, expected, rows)
    late = found.time > LEAD + 0.5
    assert found.torque[late] == pytest.approx(alike.measured[late], abs=0.1)
