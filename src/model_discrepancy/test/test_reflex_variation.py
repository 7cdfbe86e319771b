"""A reflex or a stiffness that changes in the course of time is seen on the independent rig, and a
usual one is not.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ankle_physics.model import Model
from ankle_physics.virtual_rig import simulate
from model_discrepancy.criticism.variability import (
    LEAST_VARIATION,
    USUAL_REFLEX_JITTER,
    USUAL_STIFFNESS_AFTER_MOVEMENTS,
    USUAL_STIFFNESS_VARIATION,
    variability,
)
from model_discrepancy.fit.reflex_variation import moved_from_rest
from model_discrepancy.problem import prepare
from model_discrepancy.recording.recording import Recording
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings as PerturbationSettings
from simulation_study.verdict_cases import Plan, made


def recording(*hidden, protocol="random_levels", variability_of_subject="large", seed=77):
    plan = Plan(
        *("foreign", 0, seed, hidden, "stiff", protocol, 1000.0),
        velocity=True,
        reference=True,
        noise="quiet",
        variability=variability_of_subject,
    )
    return made(plan).recording


def varies(*hidden, **conditions):
    return varies_in(recording(*hidden, **conditions))


def varies_in(one):
    problem = prepare(one)
    return variability(problem.fitter, problem.base, problem.recording.torque)


@pytest.mark.slow
def test_the_usual_variation_of_a_reflex_is_independent_and_in_time():
    found = varies()
    assert 0.1 < found.reflex[0] < 0.4
    assert found.timing[0] < 0.4 * USUAL_REFLEX_JITTER
    assert abs(found.serial[0]) < 3.0 * found.serial[1]
    assert found.stiffness[0] < 0.5 * USUAL_STIFFNESS_VARIATION
    assert found.stiffness_after[0] < 0.5 * USUAL_STIFFNESS_AFTER_MOVEMENTS
    assert found.unusual == []
    assert found.unsteady == []


@pytest.mark.slow
def test_a_delay_that_wanders_is_measured():
    found = varies("wandering_delay")
    assert found.timing[0] == pytest.approx(0.009, abs=0.004)  # rms 10 ms, within its range
    assert "earlier and later" in found.unexplainable[0]


def test_a_reflex_that_is_turned_down_in_bouts_is_seen():
    found = varies("reflex_bouts", variability_of_subject="small")
    assert found.serial[0] > 3.0 * found.serial[1]
    assert found.timing[0] < 0.4 * USUAL_REFLEX_JITTER
    assert "several stretches at a time" in found.unexplainable[0]


@pytest.mark.slow
def test_the_size_of_changes_of_the_stiffness_is_measured():
    """The stiffness is larger or smaller by 15 % at random, three times a second."""
    steady = recording(variability_of_subject="small")
    problem = prepare(steady)
    sides = np.random.default_rng(3).choice([-1.0, 1.0], 3 * int(steady.duration) + 3)
    change = 0.15 * problem.base.values["stiffness"]["K"] * sides[(3.0 * steady.time).astype(int)]
    angle = steady.position - steady.position.mean()
    varied = replace(steady, torque=steady.torque + change * angle)
    found = varies_in(varied)
    assert found.stiffness[0] == pytest.approx(0.15, abs=0.03)
    assert "larger and smaller by 1" in found.unsteady[0]
    # It is a share of the base model's stiffness, whatever a found model leaves of it.
    problem = prepare(varied)
    hidden = replace(
        problem.base, values={**problem.base.values, "stiffness": {"K": 0.01, "x0": 0.0}}
    )
    beside = variability(problem.fitter, hidden, varied.torque, problem.base)
    assert beside.stiffness == pytest.approx(found.stiffness, rel=0.1)


def test_a_startle_that_stiffens_the_joint_is_seen_and_is_no_matter_of_the_reflex():
    found = varies("startle_stiffening", variability_of_subject="small")
    value, error = found.stiffness_after
    assert value > USUAL_STIFFNESS_AFTER_MOVEMENTS
    assert any("from one moment to the next" in sentence for sentence in found.unsteady)
    assert found.unusual == []
    content = found.content()["stiffness_after_movements"]
    assert content["share_of_mean[1]"] == [value, error]


@pytest.mark.slow
def test_a_startle_shows_where_the_joint_is_held_and_not_while_it_is_moved():
    """Pulses and steps: pieces of the recording that hold a movement weigh most among all."""
    found = varies("startle_stiffening", variability_of_subject="small", protocol="pulse_step")
    assert found.stiffness[0] < USUAL_STIFFNESS_VARIATION
    assert found.stiffness_after[0] > 1.5 * USUAL_STIFFNESS_AFTER_MOVEMENTS
    assert "from one movement to the next" in found.unsteady[-1]


@pytest.mark.slow
def test_responses_that_overlap_do_not_tell_which_stretch_differs():
    found = varies(protocol="multisine")
    assert found.timing is None
    assert found.serial is None
    assert found.stiffness is None
    assert found.unusual == []


def test_what_varies_beyond_the_band_of_the_reflex_counts_with_its_own_size():
    """A servo's mode rings with some hundredths of a newton metre after each movement, while the
    reflex varies as it usually does.
    """
    usual = recording(protocol="pulse_step")
    random = np.random.default_rng(4)
    speed = np.abs(usual.velocity)
    starts = np.flatnonzero((speed[1:] > 0.1) & (speed[:-1] <= 0.1))
    ringing = np.zeros(len(usual.torque))
    length = int(0.12 * usual.rate)
    burst = np.sin(2.0 * np.pi * 60.0 * np.arange(length) / usual.rate)
    for start in starts[starts < len(ringing) - length]:
        ringing[start : start + length] = 0.06 * random.standard_normal() * burst
    found = varies_in(replace(usual, torque=usual.torque + ringing))
    assert found.variation > LEAST_VARIATION
    assert found.unusual == []


def test_a_movement_during_an_earlier_response_is_not_one_from_rest():
    """The rows follow a pulse from rest, one 0.2 s after it, and one 0.5 s later; a pulse goes
    back at once and is one movement.
    """
    velocity = np.zeros(2000)
    for onset in (500, 540, 740, 780, 1280, 1320):
        velocity[onset : onset + 5] = 1.0
    rows = SimpleNamespace(time=np.array([0.4, 0.6, 0.8, 1.2, 1.4]))
    fitter = SimpleNamespace(motion=SimpleNamespace(velocity=velocity, rate=1000.0), rows=rows)
    assert moved_from_rest(fitter).tolist() == [False, True, False, False, True]


@pytest.mark.slow
def test_an_earlier_reflex_that_varies_is_not_taken_for_the_response_to_the_next_movement():
    """With movements that come before the last response has ended."""
    found = varies(protocol="binary", seed=79)
    assert found.unusual == []


@pytest.mark.slow
def test_responses_of_a_varying_reflex_that_overlap_are_no_stiffness_that_varies():
    """In a binary sequence every second movement begins while a response lasts."""
    found = varies(protocol="binary")
    assert found.reflex[0] > 0.1
    for value, error in (found.stiffness, found.stiffness_after):
        assert value < 2.5 * error


@pytest.mark.parametrize("rms", [2.0, 8.0])
def test_slow_torque_does_not_make_the_stiffness_vary(rms):
    """What a whitening leaves of it lies along smooth shapes more than in single rows."""
    rate = 1024.0
    command = PulseStep(PerturbationSettings(rate=rate)).next(round(40.0 * rate))
    core = {"inertia": {}, "viscosity": {}, "stiffness": {"K": 80.0}, "reflex": {}}
    model = Model.of({**core, "voluntary_torque": {"rms": rms}})
    done = simulate(command, rate, model, seed=1)
    found = varies_in(
        Recording(rate, done.position, done.torque, done.velocity, command[:, 0], name="slow")
    )
    for value, error in (found.stiffness, found.stiffness_after):
        assert value < 2.5 * error
    assert found.unsteady == []
