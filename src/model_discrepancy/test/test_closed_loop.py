"""Dry friction holds a plate whose servo gives way, against torque that no movement causes."""

import numpy as np
import pytest

import model_discrepancy.loaded_servo
from ankle_physics.model import PAPER_TERMS, Model
from ankle_physics.virtual_rig import simulate
from model_discrepancy.fit.closed_loop import Load, undisturbed
from model_discrepancy.fit.parallel import side_by_side
from model_discrepancy.problem import Problem, prepare
from model_discrepancy.recording.compliance import COMPLIANCE_POLES_S, Compliance
from model_discrepancy.recording.motion import Motion
from model_discrepancy.recording.recording import Recording
from model_discrepancy.search.acting_stretches import acting_stretches
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings

RATE, MODEL_RATE, STEPS_PER_SAMPLE = 1024.0, 512.0, 64
GIVING, K = 4e-4, 100.0
LOAD = Load(0.01, 0.6, 80.0, {"coulomb_friction": {"F": 1.0, "v0": 0.02, "T": 0.0}})


def moved(pushed: np.ndarray) -> Motion:
    """Return the movement of a plate on a spring whose other end steps, where torque is pushed."""
    swing = np.sin(2.0 * np.pi * 0.7 * np.arange(len(pushed)) / MODEL_RATE)
    angle = 0.02 * np.tanh(10.0 * swing)
    dt = 1.0 / (MODEL_RATE * STEPS_PER_SAMPLE)
    friction = LOAD.friction["coulomb_friction"]
    x, v, rows = 0.0, 0.0, []
    for torque, driven in zip(pushed, angle, strict=True):
        for _ in range(STEPS_PER_SAMPLE):
            dry = friction["F"] * np.tanh(v / friction["v0"])
            pull = (driven - x) / GIVING - LOAD.stiffness * x - LOAD.viscosity * v - dry - torque
            v += dt * pull / LOAD.inertia
            x += dt * v
        rows.append((x, v, pull / LOAD.inertia))
    position, velocity, acceleration = np.array(rows).T
    return Motion(MODEL_RATE, position, velocity, acceleration, pushed, np.zeros(len(pushed)))


def test_the_movement_without_a_push_is_known_beside_friction():
    """Without the friction the push seems to have moved the resting plate."""
    random = np.random.default_rng(1)
    pushed = np.convolve(random.standard_normal(4096), np.hanning(100) / 10.0, mode="same")
    weights = np.concatenate([[GIVING], np.zeros(len(COMPLIANCE_POLES_S))])
    compliance = Compliance(MODEL_RATE, weights, (GIVING, 1e-6))
    before, alone = moved(pushed), moved(np.zeros(len(pushed)))
    inner = slice(500, -500)

    def apart(load: Load) -> float:
        found = undisturbed(before, compliance, pushed, load)
        return float(np.std((found.position - alone.position)[inner]))

    made = float(np.std((before.position - alone.position)[inner]))
    frictionless = Load(LOAD.inertia, LOAD.viscosity, LOAD.stiffness)
    assert apart(frictionless) > 0.2 * made
    assert apart(LOAD) < 0.05 * made


def beside_friction(problem: Problem) -> tuple[float, float]:
    """Return what is still predictable beside friction [1], and the stiffness [N.m/rad]."""
    terms = [*problem.base.terms, "coulomb_friction", "friction_turning"]
    fit = problem.fitter.fit(terms, problem.base.values)
    return problem.predicted(fit), fit.values["stiffness"]["K"]


def recorded(model: Model) -> Recording:
    """Return a recording with its command."""
    reference = PulseStep(Settings(rate=RATE, seed=4)).next(int(40 * RATE))
    made = simulate(reference, RATE, model, seed=4)
    return Recording(
        RATE, made.position, made.torque, made.velocity, reference[:, 0], name="friction"
    )


@pytest.mark.slow
def test_a_recording_with_friction_on_a_servo_that_gives_way_is_explained(monkeypatch):
    """The base model has no friction: that it is there is seen at once."""
    model = Model.of(
        {
            **{name: {} for name in PAPER_TERMS},
            "stiffness": {"K": K},
            "servo_compliance": {"k_a": 2000.0},
            "coulomb_friction": {"F": 1.0, "v0": 0.02},
            "voluntary_torque": {"rms": 0.4, "cutoff": 4.0},
        }
    )
    recording = recorded(model)
    with side_by_side():
        predictable, stiffness = beside_friction(prepare(recording))
        assert predictable < 0.05
        assert stiffness == pytest.approx(K, rel=0.03)
        monkeypatch.setattr(model_discrepancy.loaded_servo, "CLEAR_FRICTION", 2.0)
        assert beside_friction(prepare(recording))[0] > 0.07


@pytest.mark.slow
def test_no_other_mismatch_is_taken_for_friction(monkeypatch):
    """The movement is then the same as if nobody had looked for friction."""
    model = Model.of(
        {
            **{name: {} for name in PAPER_TERMS},
            "servo_compliance": {"k_a": 2000.0},
            "maxwell_relaxation": {"k": 40.0, "T": 0.05},
            "voluntary_torque": {},
        }
    )
    recording = recorded(model)
    looked = prepare(recording).fitter.motion.position
    monkeypatch.setattr(model_discrepancy.loaded_servo, "CLEAR_FRICTION", 2.0)
    assert np.array_equal(looked, prepare(recording).fitter.motion.position)


def test_energies_of_any_size_are_counted():
    """A candidate that is not fitted yet may have energies whose squares exceed any number."""
    assert acting_stretches(np.full(5, 1e200)) == pytest.approx(5.0)
    assert acting_stretches(np.zeros(5)) == 0.0
    assert acting_stretches(np.array([1.0, np.inf])) == 0.0
