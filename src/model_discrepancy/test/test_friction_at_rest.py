"""How much stiffness friction at rest may imitate, as far as a recording tells."""

from dataclasses import replace

import numpy as np
import pytest

from ankle_physics.terms.coulomb_friction import CoulombFriction, direction
from model_discrepancy.problem import prepare
from model_discrepancy.report import friction_at_rest
from model_discrepancy.report.friction_at_rest import (
    held_at_rest,
    stiffness_of_friction_at_rest,
)
from simulation_study.planted_trials import simulate_trial

F, STEP = 1.5, 0.03


def fitted(protocol, monkeypatch, holds=0.0):
    """Return a fitter, the fit with friction, and by how much its K is too high.

    Parameters
    ----------
    holds
        Share of the friction that stays at rest in the recording.
    """

    def torque(self, signals, values, state):
        moving = direction(signals, 0.01, 0.0)
        return {"F": moving + holds * held_at_rest(moving)}

    def recorded(planted):
        return simulate_trial(planted, seed=4, duration=40.0, protocol=protocol, velocity=True)

    with monkeypatch.context() as patched:
        patched.setattr(CoulombFriction, "torque", torque)
        recording = recorded({"coulomb_friction": {"F": F}})
    problem = prepare(recording)
    values = {**problem.base.values, "coulomb_friction": {"F": F, "v0": 0.01, "T": 0.0}}
    fit = problem.fitter.fit(list(values), values)
    right = prepare(recorded({})).base.values["stiffness"]["K"]
    return problem.fitter, fit, fit.values["stiffness"]["K"] - right


def test_friction_holds_the_direction_of_the_movement_that_has_ended():
    moving = np.array([0.0, 1.0, 1.0, 0.2, 0.0, -0.9, 0.0, 0.1])
    assert held_at_rest(moving) == pytest.approx([0.0, 0.0, 0.0, 0.8, 1.0, -0.1, -1.0, -0.9])


def test_angles_reached_from_both_sides_tell_that_nothing_is_held(monkeypatch):
    fitter, fit, _ = fitted("random", monkeypatch)
    assert stiffness_of_friction_at_rest(fitter, fit, STEP) < 0.1 * F / STEP


def test_torque_that_is_held_widens_the_error_of_the_stiffness(monkeypatch):
    fitter, fit, off = fitted("random", monkeypatch, holds=1.0)
    without = stiffness_of_friction_at_rest(*fitted("random", monkeypatch)[:2], STEP)
    error = stiffness_of_friction_at_rest(fitter, fit, STEP)
    print(off, error, without)
    assert error > 3.0 * without
    assert abs(off) < 2.0 * error


def test_without_friction_there_is_no_such_error(monkeypatch):
    problem = prepare(simulate_trial({}, seed=4, duration=20.0))
    assert stiffness_of_friction_at_rest(problem.fitter, problem.base, STEP) == 0.0


def test_nothing_tells_of_a_plate_that_never_rests(monkeypatch):
    fitter, fit, _ = fitted("random", monkeypatch)
    monkeypatch.setattr(friction_at_rest, "held_at_rest", np.zeros_like)
    size = fit.values["coulomb_friction"]["F"]
    error = stiffness_of_friction_at_rest(fitter, fit, STEP)
    assert error == pytest.approx(size / (3.0**0.5 * STEP))


def test_friction_of_another_equation_is_asked_too(monkeypatch):
    fitter, fit, _ = fitted("random", monkeypatch)
    error = stiffness_of_friction_at_rest(fitter, fit, STEP)
    own = replace(fit, values={**fit.values, "coulomb_friction": {"F": F}})
    monkeypatch.setattr(fitter, "derivatives", lambda _: derivatives)
    derivatives = type(fitter).derivatives(fitter, fit)
    assert stiffness_of_friction_at_rest(fitter, own, STEP) < 3.0 * error
