"""A servo that gives way against an independent integration, and its sag."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ankle_physics.actuator import Servo
from ankle_physics.errors import ModelError
from ankle_physics.model import Model
from ankle_physics.sensors import NO_NOISE
from ankle_physics.servo_loop import ServoLoop
from ankle_physics.signals import Signals
from ankle_physics.term import term_library
from ankle_physics.terms.coulomb_friction import CoulombFriction
from ankle_physics.virtual_rig import VirtualRig, simulate

RATE = 2048.0
JOINT = {"inertia": {"I": 0.012}, "viscosity": {"B": 0.7}, "stiffness": {"K": 100.0}}
FRICTION = {"F": 1.0, "v0": 0.02}


def steps(seconds=2.0, each=((0.3, 0.04), (0.9, -0.04), (1.4, 0.03))):
    time = np.arange(int(seconds * RATE)) / RATE
    x, v, a = np.zeros((3, len(time)))
    for at, size in each:
        s = np.clip((time - at) / 0.03, 0.0, 1.0)
        x += size * s**3 * (10 - 15 * s + 6 * s**2)
        v += size * 30 * s**2 * (1 - s) ** 2 / 0.03
        a += size * 60 * s * (1 - s) * (1 - 2 * s) / 0.03**2
    return np.column_stack([x, v, a])


def test_the_plate_follows_the_equation_of_servo_and_joint():
    reference = steps()
    model = Model.of(JOINT | {"servo_compliance": {"k_a": 1200.0}})
    made = simulate(reference, RATE, model, Servo(25.0, 0.6), NO_NOISE)
    time = np.arange(len(reference)) / RATE
    w = 2 * np.pi * 25.0
    share = w**2 / 1200.0

    def slope(t, y):
        command = np.interp(t, time, reference[:, 0])
        push = w**2 * (command - y[0]) - 2 * 0.6 * w * y[1] - share * (0.7 * y[1] + 100.0 * y[0])
        return [y[1], push / (1.0 + share * 0.012)]

    true = solve_ivp(slope, [0, time[-1]], [0, 0], t_eval=time, max_step=5e-4, rtol=1e-8)
    # The sampler's anti-alias filter delays by a part of a sample.
    lag = np.linspace(0.0, 1.5, 61)
    gaps = [np.std(np.interp(time - s / RATE, time, true.y[0]) - made.position) for s in lag]
    assert min(gaps) < 5e-4 * np.std(true.y[0])


@pytest.mark.parametrize(
    "term",
    [
        "lost_motion",
        pytest.param("recovering_lost_motion", marks=pytest.mark.slow),
        pytest.param("coulomb_friction", marks=pytest.mark.slow),
    ],
)
def test_torque_that_jumps_at_a_reversal_has_one_motion(term):
    """The sign of the velocity at a single sample hangs on the torque, and the torque on it; at
    twice the rate the jump lies elsewhere, and the plate moves the same.
    """
    sizes = {"lost_motion": {"gap": 0.005}, "recovering_lost_motion": {"gap": 0.005}}
    model = JOINT | {term: sizes.get(term, {}), "servo_compliance": {"k_a": 3000.0}}
    levels = np.random.default_rng(3).uniform(-0.03, 0.03, 60)
    jumps = zip(0.2 + 0.15 * np.arange(60), np.diff(levels, prepend=0.0), strict=True)
    coarse = steps(9.5, tuple(jumps))
    fine = np.repeat(coarse, 2, axis=0)
    fine[1:-1:2] = 0.5 * (fine[:-2:2] + fine[2::2])
    at_rate, at_twice = (
        simulate(reference, rate, Model.of(model), Servo(), NO_NOISE).position
        for reference, rate in ((coarse, RATE), (fine, 2.0 * RATE))
    )
    assert np.std(at_rate - at_twice[::2]) < 0.01 * np.std(at_rate)


def test_friction_of_a_resting_plate_is_solved_in_few_rounds(monkeypatch):
    """A plate with friction on a servo that gives way is simulated while a session runs."""
    model = Model.of(JOINT | {"coulomb_friction": FRICTION, "servo_compliance": {"k_a": 2000.0}})

    def rounds(steepness: float) -> int:
        monkeypatch.setattr(
            CoulombFriction, "drag", staticmethod(lambda v, speed: steepness * drag(v, speed))
        )
        solved = []
        answer = ServoLoop._answer
        with monkeypatch.context() as counted:
            counted.setattr(ServoLoop, "_answer", lambda *given: solved.append(1) or answer(*given))
            simulate(steps(), RATE, model, Servo(), NO_NOISE)
        return len(solved)

    drag = CoulombFriction.drag
    assert 4 * rounds(1.0) < rounds(0.0)


@pytest.mark.parametrize("term", ["coulomb_friction", "footplate_friction", "friction_turning"])
def test_the_drag_is_the_slope_of_the_torque(term):
    found = term_library()[term]
    values = {p.symbol: 0.4 if p.linear else p.default for p in found.parameters}
    slight = 1e-5

    def torque(speed: float) -> float:
        signals = Signals(RATE, np.zeros(1), np.array([speed]), np.zeros(1))
        return sum(0.4 * column[0] for column in found().torque(signals, values, {}).values())

    for speed in (0.0, 0.006, -0.02):
        slope = (torque(speed + slight) - torque(speed - slight)) / (2.0 * slight)
        assert found.drag(values, speed) == pytest.approx(slope, rel=1e-3)


def test_it_sags_under_load_and_not_without():
    reference = np.zeros((4096, 3))
    reference[:, 0] = 0.05
    model = Model.of(
        {"stiffness": {"K": 100.0}, "inertia": {"I": 0.01}, "servo_compliance": {"k_a": 900.0}}
    )
    made = simulate(reference, RATE, model, Servo(), NO_NOISE)
    assert made.position[0] == pytest.approx(0.05 * 900.0 / 1000.0, rel=1e-6)
    assert made.position[-1] == pytest.approx(0.05 * 900.0 / 1000.0, rel=1e-6)
    free = Model.of({"inertia": {"I": 0.01}, "servo_compliance": {"k_a": 900.0}})
    assert simulate(reference, RATE, free, Servo(), NO_NOISE).position[-1] == pytest.approx(0.05)


@pytest.mark.parametrize("extra", [{}, {"fixation_compliance": {"k_s": 1500.0, "b_s": 2.0}}])
def test_the_same_whatever_the_size_of_the_stretches(extra):
    reference = steps(1.2)
    values = JOINT | {"reflex": {"G": 9.0}, "servo_compliance": {"k_a": 1500.0}} | extra
    whole = VirtualRig(Model.of(values), RATE, Servo()).run(reference)
    pieces = VirtualRig(Model.of(values), RATE, Servo())
    parts = [pieces.run(reference[k : k + 128]).clean for k in range(0, len(reference), 128)]
    assert np.abs(np.concatenate(parts) - whole.clean).max() < 1e-6
    rigid = VirtualRig(Model.of({**values, "servo_compliance": {"k_a": 1e6}}), RATE, Servo())
    plain = {name: own for name, own in values.items() if name != "servo_compliance"}
    stiff = VirtualRig(Model.of(plain), RATE, Servo()).run(reference)
    assert np.abs(rigid.run(reference).clean[:, 0] - stiff.clean[:, 0]).max() < 2e-5
    assert np.abs(whole.clean[:, 0] - stiff.clean[:, 0]).max() > 5e-4


def test_voluntary_torque_moves_the_plate():
    pushing = JOINT | {
        "voluntary_torque": {"level": 4.0, "rms": 0.0},
        "servo_compliance": {"k_a": 1000.0},
    }
    made = simulate(np.zeros((512, 3)), RATE, Model.of(pushing), Servo(), NO_NOISE)
    assert made.position[-1] == pytest.approx(-4.0 / 1100.0, rel=1e-3)


def test_an_ideal_servo_cannot_give_way():
    with pytest.raises(ModelError, match="needs a bandwidth"):
        VirtualRig(Model.of(JOINT | {"servo_compliance": {}}), RATE, Servo(0.0))
