"""The rig without effects is the paper's model; each effect adds what was demanded."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lsim, lti

from blind_rig import effects, strength
from blind_rig.anatomy import Sensors, Setup
from blind_rig.protocols import EVERY_PROTOCOL, Protocol, command
from blind_rig.sensors import before_gear
from blind_rig.subjects import draw_subject
from blind_rig.trial import Trial, record, run

# Unexplained share of the torque's variance: integration at 8 kHz and a torque cell that is stiff,
# not rigid.
NULL_TOLERANCE = 1e-4


def _trial(
    setup: Setup,
    kind: str = "random_levels",
    seconds: float = 8.0,
    rate: float = 1000.0,
    seed: int = 3,
) -> Trial:
    return Trial(setup, Protocol(kind, 0.035, 0.02, seconds), rate, 0.1, seed)


@pytest.mark.parametrize(
    ("kind", "rate"), [("pulse_step", 2048.0), ("equal_steps", 1000.0), ("random_levels", 2048.0)]
)
def test_without_effects_torque_is_the_papers_equation(kind: str, rate: float) -> None:
    """The torque is computed once more from the plate's motion, with nothing fitted."""
    setup = draw_subject(np.random.default_rng(1))
    trial = _trial(setup, kind, rate=rate)
    done = run(trial)
    m, r, rig = setup.muscle, setup.reflex, setup.rig
    t = np.arange(len(done.command)) / done.rate
    x = done.motion.plate
    v = np.gradient(x, t)
    a = np.gradient(v, t)
    stretch = np.interp(t - r.delay, t, np.maximum(v, 0.0), left=0.0)
    _, reflex, _ = lsim(lti([r.omega**2], [1.0, 2 * r.zeta * r.omega, r.omega**2]), stretch, t)
    angle = trial.operating_angle + x
    weight = (
        rig.foot_mass * 9.81 * (rig.foot_forward * np.cos(angle) + rig.foot_below * np.sin(angle))
    )
    expected = (
        (rig.foot_inertia + rig.plate_inertia) * a
        + m.B * v
        + m.K * x
        + r.G * reflex
        + weight
        + done.course.voluntary
    )
    after = t > 0.5
    error = (done.motion.torque - expected)[after]
    assert error.var() < NULL_TOLERANCE * done.motion.torque[after].var()
    assert abs(error.mean()) < 0.01


def test_reflex_acts_on_dorsiflexion_only_and_after_its_delay() -> None:
    setup = Setup().replaced({"courses.voluntary_rms": 1e-6, "reflex.G": 10.0})
    trial = _trial(setup, "pulse_step", 4.0)
    with_reflex, without = run(trial), run(trial._replace(setup=setup.replaced({"reflex.G": 0.0})))
    added = with_reflex.motion.torque - without.motion.torque
    first = int(np.argmax(with_reflex.motion.plate_velocity > 1e-3))
    late = round((setup.reflex.delay - 0.001) * with_reflex.rate)
    assert np.abs(added[: first + late]).max() < 1e-3
    assert added.max() > 0.5
    assert added.min() > -0.25 * added.max()


def test_maxwell_element_relaxes_as_a_spring_behind_a_dashpot() -> None:
    from blind_rig.anatomy import Muscle
    from blind_rig.ankle_torque import MUSCLE_STATES, intrinsic_torque

    muscle, dt = Muscle(K=0.0, B=0.0, maxwell_k=50.0, maxwell_tau=0.1), 1e-4
    t = np.arange(0, 0.5, dt)
    v = np.where(t < 0.02, 1.0, 0.0)
    state = np.zeros(MUSCLE_STATES)
    torque = np.array([intrinsic_torque(0.0, speed, 1.0, muscle, state, dt) for speed in v])
    solution = solve_ivp(
        lambda s, y: 50.0 * float(s < 0.02) - y / 0.1,
        (0, 0.5),
        [0.0],
        t_eval=t,
        max_step=1e-3,
        rtol=1e-8,
    )
    assert np.abs(torque - solution.y[0]).max() < 0.01 * solution.y[0].max()


def test_static_stiffness_with_a_tendon_is_the_joints() -> None:
    from blind_rig.anatomy import Muscle
    from blind_rig.ankle_torque import MUSCLE_STATES, intrinsic_torque

    muscle, state = Muscle(K=100.0, tendon_share=0.5, contractile_b=5.0), np.zeros(MUSCLE_STATES)
    for _ in range(20000):
        torque = intrinsic_torque(0.01, 0.0, 1.0, muscle, state, 1e-4)
    assert torque == pytest.approx(1.0, rel=1e-3)


def test_play_lets_the_foot_move_no_further_than_its_stops() -> None:
    gap = 0.002
    setup = Setup().replaced({"rig.strap_k": 600.0, "rig.strap_b": 1.0, "rig.strap_gap": gap})
    done = run(_trial(setup, "pulse_step", 4.0))
    apart = np.abs(done.motion.foot - done.motion.plate)
    assert apart.max() > 0.8 * gap
    assert np.quantile(apart, 0.99) < 1.3 * gap


def test_the_plate_behind_an_uneven_gear_is_ahead_of_the_shaft_by_its_error() -> None:
    sensors = Sensors(gear_error=0.0015, gear_pitch=0.02, gear_skewness=0.2)
    time = np.arange(4000) / 1000.0
    plate = 0.03 * np.sin(2 * math.pi * time)
    shaft, velocity = before_gear(plate, np.gradient(plate, time), sensors)
    turn = 2 * math.pi / 0.02
    ahead = 0.0015 * (np.sin(turn * shaft) + 0.2 * np.sin(2 * turn * shaft))
    np.testing.assert_allclose(shaft + ahead, plate, atol=1e-9)
    np.testing.assert_allclose(velocity[2:-2], np.gradient(shaft, time)[2:-2], atol=0.02)


def test_same_seed_gives_the_same_trial_and_the_effect_alone_differs() -> None:
    setup = draw_subject(np.random.default_rng(2))
    first, again = run(_trial(setup)), run(_trial(setup))
    assert np.array_equal(first.motion.torque, again.motion.torque)
    tremulous = run(_trial(setup.replaced({"courses.tremor_rms": 0.3})))
    assert np.array_equal(first.course.steady, tremulous.course.steady)
    assert np.array_equal(first.command, tremulous.command)


def test_noise_has_the_stated_power() -> None:
    setup = draw_subject(np.random.default_rng(5)).replaced(
        {"sensors.torque_snr": 24.1, "sensors.position_snr": 52.7}
    )
    trial = _trial(setup)
    done = run(trial)
    quiet = record(
        trial._replace(
            setup=setup.replaced({"sensors.torque_snr": 300.0, "sensors.position_snr": 300.0})
        ),
        done,
    )
    noisy = record(trial, done)
    for clean, dirty, snr in (
        (quiet.torque, noisy.torque, 24.1),
        (quiet.position, noisy.position, 52.7),
    ):
        assert 20 * math.log10(clean.std() / (dirty - clean).std()) == pytest.approx(snr, abs=0.3)


def test_edges_move_both_ways_and_stay_in_range() -> None:
    for kind in EVERY_PROTOCOL:
        angle, onsets = command(Protocol(kind, 0.03, 0.024, 60.0), np.random.default_rng(0), 1000.0)
        assert np.abs(angle).max() <= 0.03 + 1e-12
        assert (np.diff(angle) > 0).any()
        assert (np.diff(angle) < 0).any()
        assert len(onsets) > 60


def _reaches(effect: effects.Effect, wanted: str, seconds: float) -> strength.Scaled:
    generator = np.random.default_rng(11)
    kind = (effect.protocols or ("random_levels",))[0]
    trial = _trial(draw_subject(generator).replaced({"reflex.G": 15.0, "muscle.K": 60.0}), kind)
    return strength.scale(
        trial._replace(protocol=trial.protocol._replace(duration=seconds)),
        effect,
        *effects.draw_shape(effect, generator),
        strength.STRENGTHS[wanted],
    )


@pytest.mark.parametrize("name", ["maxwell", "torque_delay"])
def test_effect_adds_the_demanded_share(name: str) -> None:
    scaled = _reaches(effects.EFFECTS_BY_NAME[name], "moderate", 6.0)
    assert scaled.share == pytest.approx(0.02, rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize(
    "effect", [e for e in effects.EFFECTS_BY_NAME.values() if not e.levels], ids=lambda e: e.name
)
def test_every_effect_can_be_made_visible(effect: effects.Effect) -> None:
    """Weak is within reach of every effect, and is met."""
    assert _reaches(effect, "weak", 16.0).share == pytest.approx(0.005, rel=0.15)


def test_truth_is_judged_against_the_model_it_claims() -> None:
    """A change that the paper's model absorbs counts as none."""
    setup = draw_subject(np.random.default_rng(6))
    trial = _trial(setup)
    plain = strength.unexplained_variance(run(trial), trial)
    stiffer = trial._replace(
        setup=setup.replaced(
            {"muscle.K": 1.3 * setup.muscle.K, "rig.foot_inertia": 1.2 * setup.rig.foot_inertia}
        )
    )
    assert strength.share(stiffer, plain) < 1e-4
    later = trial._replace(
        setup=setup.replaced(
            {
                "reflex.delay": setup.reflex.delay + 0.002,
                "reflex.omega": 1.05 * setup.reflex.omega,
                "reflex.zeta": 0.95 * setup.reflex.zeta,
            }
        )
    )
    assert strength.share(later, plain) < 1e-3
