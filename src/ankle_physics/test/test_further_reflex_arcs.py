"""A tonic reflex begins at a length; a late one is sought beside a response not drawn out by it."""

import numpy as np
import pytest

from ankle_physics.impedance import OperatingPoint, effective_stiffness, reflex_gain
from ankle_physics.model import Model
from ankle_physics.signals import Signals
from ankle_physics.term import term_library

RATE = 1000.0
JOINT = {
    "inertia": {"I": 0.012},
    "viscosity": {"B": 0.8},
    "stiffness": {"K": 60.0},
    "reflex": {"G": 8.0},
}


def held_at(angle):
    x = np.full(3000, angle)
    return Signals(RATE, x, np.zeros(3000), np.zeros(3000))


@pytest.mark.parametrize(("angle", "torque"), [(0.03, 0.0), (0.05, 0.6), (0.09, 3.0)])
def test_the_tonic_reflex_begins_at_its_threshold(angle, torque):
    reflex = Model.of({"length_threshold_reflex": {"Gp": 60.0, "xc": 0.02, "threshold": 0.02}})
    assert reflex.torque(held_at(angle))[-1] == pytest.approx(torque, abs=1e-6)


def test_below_its_threshold_it_is_the_reflex_to_position():
    values = {"Gp": 60.0, "delay": 0.06, "omega": 20.0, "xc": 0.0}
    x = 0.02 * np.sin(2.0 * np.pi * 0.7 * np.arange(6000) / RATE)
    moved = Signals(RATE, x, np.gradient(x) * RATE, np.zeros(6000))
    whole, part = (
        Model.of({name: given}).torque(moved)[2000:]
        for name, given in (
            ("position_reflex", values),
            ("length_threshold_reflex", values | {"threshold": -0.2}),
        )
    )
    # It holds more, and answers the movement alike.
    np.testing.assert_allclose(part - whole, 12.0, rtol=1e-6)
    assert "position_reflex" in term_library()["length_threshold_reflex"].generalises


def test_it_counts_in_the_effective_stiffness_and_not_in_g():
    at = OperatingPoint()
    tonic = Model.of(JOINT | {"length_threshold_reflex": {"Gp": 30.0, "threshold": -0.2}})
    assert reflex_gain(tonic, at) == pytest.approx(8.0, rel=1e-3)
    assert effective_stiffness(tonic, at) > effective_stiffness(Model.of(JOINT), at) + 5.0


def stretched(rise):
    """A stretch of 0.04 rad within a time [s], after half a second."""
    time = np.arange(2000) / RATE
    share = np.clip((time - 0.5) / rise, 0.0, 1.0)
    x = 0.04 * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    v = np.gradient(x) * RATE
    return Signals(RATE, x, v, np.gradient(v) * RATE)


def test_the_reflex_to_acceleration_answers_how_suddenly_a_stretch_begins():
    arc = Model.of({"acceleration_reflex": {"Gc": 0.3, "delay": 0.04}})
    sudden, slow = (np.sum(arc.torque(stretched(rise))) / RATE for rise in (0.05, 0.1))
    # What the foot gains in speed counts, 1.875 times the mean one, not the size of the stretch.
    assert sudden == pytest.approx(0.3 * 1.875 * 0.04 / 0.05, rel=0.02)
    assert sudden == pytest.approx(2.0 * slow, rel=0.02)
    assert not np.any(arc.torque(stretched(0.05))[: int(0.535 * RATE)])


def test_the_reflex_to_acceleration_does_not_count_in_g():
    both = Model.of(JOINT | {"acceleration_reflex": {"Gc": 0.3}})
    assert reflex_gain(both, OperatingPoint()) == pytest.approx(8.0, rel=1e-3)


def test_a_late_reflex_is_sought_beside_one_that_is_not_drawn_out():
    late = term_library()["long_latency_reflex"]
    assert late.begins_beside({"stiffness": {"K": 60.0}}) == []
    drawn_out = {"reflex": {"G": 9.0, "delay": 0.045, "omega": 30.0, "z": 1.2}}
    starts = late.begins_beside(drawn_out)
    assert len({start["long_latency_reflex"]["delay"] for start in starts}) == len(starts) > 1
    for start in starts:
        assert start["reflex"]["omega"] > 30.0
        assert start["reflex"]["z"] < 1.2
        assert start["reflex"]["delay"] == 0.045
    # Whatever the model, a fit can begin there.
    for start in late.begins_beside({"reflex": {"G": 9.0, "delay": 0.04, "omega": 79.0, "z": 0.3}}):
        Model.of(start)
