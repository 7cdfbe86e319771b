"""Terms that are marked as tracked are estimated beside K, B, I and G."""

import copy

import numpy as np
import pytest
from random_motion import CORE, random_motion

from ankle_physics.errors import ModelError
from ankle_physics.model import Entry, Model
from ankle_physics.signals import Signals
from impedance_estimator.known_physics import KnownPhysics
from impedance_estimator.stream import EstimateStream

RATE = 1024.0
EXTRA = {"maxwell_relaxation": {"k": 60.0, "T": 0.08}, "long_latency_reflex": {"Gl": 3.0}}


def calibrated(tracked=("maxwell_relaxation", "long_latency_reflex"), **changes):
    model = Model.of({**CORE, **EXTRA, **changes})
    model.entry("reflex").standard_errors = {"G": 0.5}
    for entry in model.entries:
        entry.tracked = entry.term.name in tracked
    return KnownPhysics(subject=model)


def samples_of(model, seconds, seed=1):
    x, v, a = random_motion(RATE, seconds)
    torque = model.start(RATE).torque(Signals(RATE, x, v, a))
    torque += np.random.default_rng(seed).normal(0.0, 0.05, len(x))
    return np.column_stack([np.arange(len(x)) / RATE, x, v, torque])


@pytest.fixture(scope="module")
def now():
    """The subject later: every gain has changed by its own factor."""
    changed = {
        **CORE,
        "stiffness": {"K": 140.0},
        "maxwell_relaxation": {"k": 30.0, "T": 0.08},
        "long_latency_reflex": {"Gl": 4.5},
    }
    return samples_of(Model.of(changed), 40.0)


@pytest.mark.parametrize("velocity", [True, False])
def test_tracked_gains_are_found_with_their_errors_and_leave_k(now, velocity):
    samples = now if velocity else np.delete(now, 2, axis=1)
    stream = EstimateStream(known=calibrated())
    due = stream.feed_samples(samples, velocity, samples[:, 1])
    assert stream.tracked_columns == (
        "maxwell_relaxation.k[N.m/rad]",
        "se_maxwell_relaxation.k[N.m/rad]",
        "long_latency_reflex.Gl[N.m.s/rad]",
        "se_long_latency_reflex.Gl[N.m.s/rad]",
    )
    time, k, error_k, G, error_G = due.tracked[-1]
    assert time == pytest.approx(40.0, abs=0.6)
    assert k == pytest.approx(30.0, rel=0.05)
    assert pytest.approx(4.5, rel=0.05) == G
    assert 0.0 < error_k < 3.0
    assert 0.0 < error_G < 0.5
    assert due.rows[-1, 1] == pytest.approx(140.0, rel=0.03)
    assert np.isnan(due.tracked[0, 1:]).all()


def test_what_is_held_instead_of_tracked_stands_in_k(now):
    held = EstimateStream(known=calibrated(tracked=())).feed_samples(now, True, now[:, 1])
    assert held.tracked.shape[1] == 1
    assert abs(held.rows[-1, 1] / 140.0 - 1.0) > 0.04


def test_the_sizes_do_not_depend_on_how_the_samples_come(now):
    short = now[: round(14 * RATE)].copy()
    short[3000, 3] = np.nan
    whole = EstimateStream(known=calibrated()).feed_samples(short, True, short[:, 1])
    stream = EstimateStream(known=calibrated())
    parts = [stream.feed_samples(p, True, p[:, 1]) for p in np.array_split(short, 61)]
    np.testing.assert_array_equal(whole.tracked, np.concatenate([p.tracked for p in parts]))
    assert np.isfinite(whole.tracked[-1]).all()


def test_the_calibrated_model_itself_is_not_changed(now):
    known = calibrated()
    before = copy.deepcopy(known.model.content())
    EstimateStream(known=known).feed_samples(now, True, now[:, 1])
    assert known.model.content() == before


@pytest.mark.parametrize("name", ["fixation_compliance", "torque_sensor_lag", "plate_appendage"])
def test_what_is_not_proportional_to_a_gain_is_not_tracked(name):
    model = Model.of({**CORE, name: {}})
    linear = any(p.linear for p in model.entry(name).term.parameters)
    entries = [Entry(e.term, e.values, tracked=True) for e in model.entries]
    if name == "plate_appendage" and linear:
        assert [e.term.name for e in KnownPhysics(subject=Model(entries)).tracked] == [name]
        return
    with pytest.raises(ModelError, match=rf"{name}.*tracked"):
        KnownPhysics(subject=Model(entries))
