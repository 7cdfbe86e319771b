"""True K and G of the independent rig against held torque and areas of responses."""

import math

import numpy as np
import pytest

from blind_rig.anatomy import Setup
from blind_rig.courses import course
from blind_rig.impedance import true_impedance, weight_stiffness
from blind_rig.magnitudes import MAGNITUDES
from blind_rig.mechanics import simulate
from blind_rig.protocols import Protocol
from blind_rig.trial import Trial, run

SECONDS = 6.0


def trial(changes=None):
    return Trial(
        Setup().replaced(changes or {}),
        Protocol("pulse_step", 0.04, 0.024, SECONDS),
        1000.0,
        0.1,
        11,
    )


def truth(changes=None):
    made = trial(changes)
    return true_impedance(made, run(made), 1.0)


def test_without_effects_they_are_the_setups_own():
    found = truth()
    assert pytest.approx(100.0 + weight_stiffness(trial())) == found.K
    assert pytest.approx(10.0, rel=0.01) == found.G


def test_a_curved_spring_has_its_slope_at_the_mean_angle():
    made = trial({"muscle.hardening": 700.0, "muscle.position_slope": 12.0})
    done = run(made)
    x = float(np.mean(done.motion.foot[8000:]))

    def torque(at):
        return 100.0 * (1.0 + 12.0 * at + 700.0 * at * at) * at

    slope = (torque(x + 1e-5) - torque(x - 1e-5)) / 2e-5
    found = true_impedance(made, done, 1.0)
    assert pytest.approx(slope + weight_stiffness(made), rel=1e-6) == found.K


def test_a_threshold_lowers_the_gain_and_a_late_arc_adds_to_it():
    assert truth({"reflex.threshold": 0.5}).G < 9.5
    late = truth({"reflex.late_G": 4.0}).G
    assert late == pytest.approx(14.0, rel=0.01)


def test_what_has_memory_and_what_gives_way_outside_the_joint_is_no_stiffness():
    effects = {"muscle.maxwell_k": 60.0, "rig.strap_k": 500.0, "rig.strap_b": 1.0}
    stiffness = truth(effects).K
    assert stiffness == pytest.approx(100.0 + weight_stiffness(trial()))


def test_a_jump_multiplies_k_and_g_from_its_time_on():
    jump = {"courses.jump_at": 3.0, "courses.jump_muscle": 1.2, "courses.jump_reflex": 3.0}
    made = trial(jump)
    done = run(made)
    before, after = true_impedance(made, done, 0.5, 3.0), true_impedance(made, done, 3.4)
    weight = weight_stiffness(made)
    assert (after.K - weight) / (before.K - weight) == pytest.approx(1.2, rel=1e-6)
    gain = after.G / before.G
    assert gain == pytest.approx(3.0, rel=0.02)


def test_a_compliant_servo_sags_under_a_constant_load():
    setup = Setup().replaced({"rig.servo_k": 2500.0, "courses.voluntary_rms": 0.0})
    n, rate = 16000, 8000.0
    still, ones = np.zeros(n), np.ones(n)
    push = np.where(np.arange(n) < n // 4, 0.0, 5.0) + setup.courses.torque_level
    delay = np.full(n, 0.04)
    motion = simulate(setup, still, push, ones, ones, delay, 0.1, rate)
    # The foot gives way against the servo and its own stiffness together.
    stiffness = 2500.0 + setup.muscle.K + weight_stiffness(trial())
    assert motion.plate[-1] == pytest.approx(-5.0 / stiffness, rel=0.02)
    rigid = simulate(Setup(), still, push, ones, ones, delay, 0.1, rate)
    assert abs(rigid.plate[-1]) < 0.02 * abs(motion.plate[-1])


@pytest.mark.parametrize("kind", ["pink_rms", "steps_rms", "ramps_rms", "bursts_peak"])
def test_every_kind_of_voluntary_torque_has_its_size_and_leaves_the_others_alone(kind):
    rate, n = 1000.0, 120_000
    quiet = {"courses.voluntary_rms": 0.0}
    made = course(Setup().replaced(quiet | {f"courses.{kind}": 0.5}), np.array([]), n, rate, 3)
    moved = made.voluntary - Setup().courses.torque_level
    size = np.abs(moved).max() if kind == "bursts_peak" else moved.std()
    assert size == pytest.approx(0.5, rel=0.35)
    assert np.all(made.reflex_scale == 1.0)


def test_the_reflex_varies_from_stretch_to_stretch_and_not_within_one():
    onsets = np.arange(0.5, 100.0, 0.5)
    setup = Setup().replaced({"courses.stretch_variation": 0.25})
    scale = course(setup, onsets, 100_000, 1000.0, 5).reflex_scale
    at_onsets = scale[(onsets[:-1] * 1000.0).astype(int) + 1]
    assert np.std(at_onsets) == pytest.approx(0.25, rel=0.2)
    assert len(np.unique(scale)) <= len(onsets) + 1


def test_every_effect_has_magnitudes_that_grow():
    for name, (weak, _, strong) in MAGNITUDES.items():
        assert not math.isclose(weak, strong), name
