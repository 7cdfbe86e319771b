"""A foot behind a compliant strap, against the full differential equation."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from ankle_physics.actuator import Servo
from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.errors import ModelError
from ankle_physics.model import Model
from ankle_physics.scenario import Scenario
from ankle_physics.sensors import NO_NOISE
from ankle_physics.signals import Signals
from ankle_physics.term import term_library
from ankle_physics.virtual_rig import simulate

RATE = 2048.0
SWAYS = ((0.02, 3.0), (0.001, 40.0))  # [rad], [Hz]; slow, and near the resonance of the strap
I, B, G, DELAY, OMEGA, Z = 0.0137, 0.63, 10.0, 0.04, 21.0, 0.8


def plate_motion(t):
    """Position, velocity, acceleration of a swaying plate that starts at rest."""
    x = v = a = 0.0
    for height, frequency in SWAYS:
        w = 2 * math.pi * frequency
        x += height * (1 - math.cos(w * t))
        v += height * w * math.sin(w * t)
        a += height * w**2 * math.cos(w * t)
    return x, v, a


def sampled(duration, rate=RATE):
    return np.array([plate_motion(k / rate) for k in range(int(duration * rate))])


def stiffness_at(t):
    return 100.0 + 60.0 * min(max((t - 0.5) / 0.1, 0.0), 1.0)


def integrated(time, k_s, b_s, maxwell_k=0.0, maxwell_T=0.05, K=stiffness_at):
    """Foot, muscle and Maxwell element as one delay equation, by the method of steps with an
    adaptive solver.

    Returns
    -------
    object
        Torque through the strap [N.m] and foot angle [rad], each of shape (n,).
    """
    steps = []

    def foot_velocity(t):
        if t <= 0.0:
            return 0.0
        return float(steps[min(int(t / DELAY), len(steps) - 1)](t)[1])

    def rates(t, y):
        foot, v, muscle, muscle_rate, lagged = y
        plate = plate_motion(t)
        strap = k_s * (plate[0] - foot) + b_s * (plate[1] - v)
        maxwell = maxwell_k * (foot - lagged)
        acceleration = (strap - B * v - K(t) * foot - G * muscle - maxwell) / I
        stretch = max(foot_velocity(t - DELAY), 0.0)
        return [
            v,
            acceleration,
            muscle_rate,
            OMEGA**2 * (stretch - muscle) - 2 * Z * OMEGA * muscle_rate,
            (foot - lagged) / maxwell_T,
        ]

    state = np.zeros(5)
    for index in range(int(np.ceil(time[-1] / DELAY))):
        span = [index * DELAY, (index + 1) * DELAY]
        part = solve_ivp(
            rates,
            span,
            state,
            method="DOP853",
            rtol=1e-8,
            atol=1e-11,
            max_step=2e-3,
            dense_output=True,
        )
        steps.append(part.sol)
        state = part.y[:, -1]
    solution = np.array([steps[min(int(t / DELAY), len(steps) - 1)](t) for t in time])
    plate = np.array([plate_motion(t) for t in time])
    return k_s * (plate[:, 0] - solution[:, 0]) + b_s * (plate[:, 1] - solution[:, 1]), solution[
        :, 0
    ]


@pytest.mark.parametrize(
    ("k_s", "b_s"), [pytest.param(400.0, 1.0, marks=pytest.mark.slow), (3000.0, 2.0)]
)
def test_strap_torque_against_the_full_equation(k_s, b_s):
    model = Model.of(
        {
            "inertia": {},
            "viscosity": {},
            "stiffness": {},
            "reflex": {},
            "maxwell_relaxation": {"k": 60.0, "T": 0.05},
            "fixation_compliance": {"k_s": k_s, "b_s": b_s},
        }
    )
    scenario = Scenario.from_content(
        {"changes": [{"at[s]": 0.5, "over[s]": 0.1, "stiffness.K[N.m/rad]": 160}]}
    )
    recording = simulate(sampled(1.0), RATE, model, Servo(0.0), NO_NOISE, scenario)
    expected, _ = integrated(recording.time, k_s, b_s, maxwell_k=60.0)
    torque = sum(recording.parts.values())
    assert np.abs(torque - expected).max() < 1e-4 * np.abs(expected).max()


def test_error_falls_with_the_square_of_the_step():
    errors = []
    for rate in (2048.0, 8192.0):
        time = np.arange(int(0.8 * rate)) / rate
        signals = Signals(rate, *sampled(0.8, rate).T)
        model = Model.of(
            {
                "inertia": {},
                "viscosity": {},
                "stiffness": {},
                "reflex": {},
                "fixation_compliance": {},
            }
        )
        expected, foot = integrated(time, 2000.0, 2.0, K=lambda t: 100.0)
        errors.append(np.abs(model.torque(signals) - expected).max() / np.abs(expected).max())
    assert errors[1] < 1e-4
    assert errors[1] < errors[0] / 10
    assert np.abs(signals.foot_position - foot).max() < 1e-4 * np.abs(foot).max()


def test_a_very_stiff_strap_is_no_strap():
    paper = {"inertia": {}, "viscosity": {}, "stiffness": {}, "reflex": {}}
    rigid = simulate(sampled(1.0), model=Model.of(paper), signal_to_noise=NO_NOISE)
    strapped = simulate(
        sampled(1.0),
        model=Model.of({**paper, "fixation_compliance": {"k_s": 50_000.0, "b_s": 30.0}}),
        signal_to_noise=NO_NOISE,
    )
    assert np.abs(strapped.torque - rigid.torque).max() < 0.02 * np.abs(rigid.torque).max()


def test_the_foot_starts_at_rest_in_equilibrium():
    model = Model.of(
        {
            "inertia": {},
            "stiffness": {"K": 100.0, "x0": -0.05},
            "fixation_compliance": {"k_s": 300.0},
        }
    )
    still = np.full(100, 0.1)
    signals = Signals(8192.0, still, np.zeros(100), np.zeros(100))
    torque = model.torque(signals)
    foot = (300 * 0.1 + 100 * -0.05) / 400
    assert np.abs(signals.foot_position - foot).max() < 1e-9
    assert np.abs(torque - 300 * (0.1 - foot)).max() < 1e-7


@pytest.mark.parametrize(
    ("strap", "K", "middle", "k1", "k3", "plate", "between"),
    [
        (300.0, 100.0, 0.0, 0.0, 1e6, 0.3, (0.0, 0.3)),
        # It would rest far away, too, where it has softened.
        (1100.0, 70.0, 0.15, 350.0, -4.6e4, 0.16, (0.14, 0.17)),
    ],
)
def test_a_foot_on_a_curve_starts_at_rest_beside_the_plate(
    strap, K, middle, k1, k3, plate, between
):
    model = Model.of(
        {
            "inertia": {},
            "stiffness": {"K": K, "x0": middle},
            "hardening_stiffness": {"k1": k1, "k3": k3, "xc": middle},
            "fixation_compliance": {"k_s": strap},
        }
    )
    still = np.full(100, plate)
    signals = Signals(8192.0, still, np.zeros(100), np.zeros(100))
    torque = model.torque(signals)

    def rest(x):
        d = x - middle
        return strap * (plate - x) - K * d - 0.5 * k1 * d**2 - k3 * d**3

    foot = brentq(rest, *between)
    assert np.abs(signals.foot_position - foot).max() < 1e-6
    assert np.abs(torque - strap * (plate - foot)).max() < 1e-3


@pytest.mark.parametrize(
    "name", [n for n, t in term_library().items() if not issubclass(t, CompliantCoupling)]
)
def test_every_other_term_works_behind_the_strap_in_blocks_as_in_one_go(name):
    x, v, a = sampled(0.3, 8192.0).T
    model = Model.of(
        {
            "inertia": {},
            "viscosity": {},
            "stiffness": {},
            "reflex": {},
            "fixation_compliance": {},
            name: {},
        }
    )
    whole = model.torque(Signals(8192.0, x, v, a))
    run = model.start(8192.0)
    cuts = [0, 1, 100, 228, 900, len(x)]
    parts = [run.torque(Signals(8192.0, x[i:j], v[i:j], a[i:j])) for i, j in pairwise(cuts)]
    assert np.abs(np.concatenate(parts) - whole).max() < 1e-8 * np.abs(whole).max()


def test_a_foot_without_inertia_is_refused():
    model = Model.of({"stiffness": {}, "fixation_compliance": {}})
    with pytest.raises(ModelError, match="needs a foot with inertia"):
        model.torque(Signals(RATE, *sampled(1.0).T))


def test_inertia_that_triples_in_mid_run_renews_the_linear_system():
    model = Model.of(
        {
            "inertia": {"I": 0.01},
            "viscosity": {"B": 3.0},
            "stiffness": {},
            "fixation_compliance": {},
        }
    )
    x, v, a = sampled(1.0, 8192.0).T
    run = model.start(8192.0)
    run.torque(Signals(8192.0, x[:6200], v[:6200], a[:6200]))
    model.entry("inertia").values["I"] = 0.03
    signals = Signals(8192.0, x[6200:], v[6200:], a[6200:])
    torque = run.torque(signals)
    strap = 2000.0 * (x[6200:] - signals.foot_position) + 2.0 * (v[6200:] - signals.foot_velocity)
    assert np.abs(torque - strap).max() < 1e-7
