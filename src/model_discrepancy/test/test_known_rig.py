"""A calibrated rig is taken as known, on recordings that scipy alone makes."""

from dataclasses import replace
from datetime import datetime, timezone

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from ankle_physics.model import PAPER_TERMS, Model
from ankle_physics.rig_file import Measured, RigFile
from model_discrepancy.diagnose import diagnose
from model_discrepancy.problem import prepare
from model_discrepancy.recording.known_rig import calibrated, held_terms, known_compliance
from model_discrepancy.recording.recording import Recording
from model_discrepancy.tools.open_set import OpenSet
from model_discrepancy.tools.recording_judgement import judge_alone

RATE = 1000.0
FOOT, PLATE, VISCOSITY, STIFFNESS = 0.014, 0.005, 0.8, 90.0
TORQUE_LATE, VELOCITY_LATE = 3, 4  # samples
RIG = RigFile(
    "laboratory 2",
    datetime(2026, 11, 20, tzinfo=timezone.utc),
    torque_delay=Measured(TORQUE_LATE / RATE),
    velocity_delay=Measured(VELOCITY_LATE / RATE),
    zero_position=0.3,
    zero_torque=-1.5,
    model=Model.of({"footplate_inertia": {"Ip": PLATE}, "servo_compliance": {"k_a": 2500.0}}),
)


def recording() -> Recording:
    """Random steps of a foot on a plate; the torque channel is late and both have an offset."""
    random = np.random.default_rng(3)
    steps = np.repeat(random.uniform(-0.02, 0.02, 120), 250)
    position = lfilter(*butter(4, 15.0, fs=RATE), steps)
    velocity = np.gradient(position) * RATE
    torque = (
        (FOOT + PLATE) * np.gradient(velocity) * RATE + VISCOSITY * velocity + STIFFNESS * position
    )
    torque = np.concatenate([np.zeros(TORQUE_LATE), torque[:-TORQUE_LATE]]) - 1.5
    velocity = np.concatenate([np.zeros(VELOCITY_LATE), velocity[:-VELOCITY_LATE]])
    noise = random.standard_normal((2, len(position)))
    return Recording(
        RATE,
        position + 0.3 + 2e-5 * noise[0],
        torque + 0.01 * np.std(torque) * noise[1],
        velocity,
    )


def test_what_the_rig_file_states_is_held_and_not_found_again():
    problem = prepare(recording(), rig=RIG)
    values = problem.base.values
    assert values["footplate_inertia"] == {"Ip": PLATE}
    assert values["channel_skew"] == {"skew": TORQUE_LATE / RATE}
    assert values["inertia"]["I"] == pytest.approx(FOOT, rel=0.02)
    assert values["viscosity"]["B"] == pytest.approx(VISCOSITY, rel=0.05)
    labels = problem.fitter.derivatives(problem.base)[1]
    assert {name for name, _ in labels} == set(PAPER_TERMS)
    used = problem.fitter.rows.used
    assert np.var(problem.base.plain[used]) < 0.002 * np.var(problem.fitter.plain_target[used])
    assert abs(problem.fitter.motion.torque.mean()) < 0.1


def test_a_delay_that_the_rig_file_states_is_no_effect():
    found = diagnose(recording(), rig=RIG, library=["channel_skew", "footplate_friction"])
    assert found.found.final.values["channel_skew"] == {"skew": TORQUE_LATE / RATE}
    assert "channel_skew" not in {effect["name"] for effect in found.verdict.effects}


def test_zeros_and_the_velocitys_clock_are_corrected():
    late = recording()
    moved = calibrated(late, RIG)
    assert moved.position.mean() == pytest.approx(late.position.mean() - 0.3)
    assert moved.torque.mean() == pytest.approx(late.torque.mean() + 1.5)
    np.testing.assert_allclose(moved.velocity[:-VELOCITY_LATE], late.velocity[VELOCITY_LATE:])


def test_names_are_judged_on_further_recordings_with_what_the_rig_file_states():
    names = ("maxwell_relaxation", "short_range_stiffness")
    terms = (*PAPER_TERMS, *held_terms(RIG))
    asked = OpenSet(names[0], {name: {key: {} for key in (*terms, name)} for name in names})
    judge_alone([asked], recording(), RIG)
    for name in names:
        fitted = asked.models[name]
        assert {term: fitted[term] for term in held_terms(RIG)} == held_terms(RIG)
        assert fitted["inertia"]["I"] == pytest.approx(FOOT, rel=0.02)


def test_the_servos_stiffness_is_a_known_compliance():
    found = known_compliance(RIG, 500.0)
    assert found.significant
    assert found.response(np.array([0.0]))[0] == pytest.approx(1 / 2500.0)
    bare = RigFile("bare", RIG.calibrated)
    assert known_compliance(bare, 500.0) is None
    assert held_terms(bare) == {}


def test_torque_that_is_read_late_moved_the_plate_when_it_acted():
    """Torque that no movement causes moves a servo that gives way; what is left of it in the
    movement would predict itself.
    """
    late, samples, compliance = 8, 40_000, 1.0 / 2500.0
    random = np.random.default_rng(5)
    command = lfilter(*butter(4, 20.0, fs=RATE), np.repeat(random.uniform(-0.02, 0.02, 160), 250))
    voluntary = 6.0 * lfilter(*butter(2, [3.0, 12.0], "band", fs=RATE), random.normal(size=samples))
    s = 2j * np.pi * np.fft.rfftfreq(samples, 1.0 / RATE)
    impedance = (FOOT + PLATE) * s**2 + VISCOSITY * s + STIFFNESS
    moved, pushed = np.fft.rfft(command), np.fft.rfft(voluntary)
    position, undisturbed = (
        np.fft.irfft((moved - compliance * push) / (1.0 + compliance * impedance), samples)
        for push in (pushed, 0.0)
    )
    torque = np.fft.irfft(impedance * np.fft.rfft(position) + pushed, samples)
    noise = random.standard_normal((2, samples))
    recorded = Recording(
        RATE,
        position + 2e-6 * noise[0],
        np.roll(torque, late) + 0.02 * noise[1],
        reference=command,
    )
    problems = [
        prepare(
            recorded,
            rig=replace(RIG, torque_delay=Measured(delay), zero_position=0.0, zero_torque=0.0),
        )
        for delay in (late / RATE, 0.0)
    ]
    inner = slice(2000, -2000)

    def disturbed(problem):
        thinned = undisturbed[:: round(RATE / problem.fitter.motion.rate)]
        left = (problem.fitter.motion.position - thinned)[inner]
        return np.std(left - left.mean()) / (compliance * np.std(voluntary))

    known, unknown = (disturbed(problem) for problem in problems)
    assert known < 0.3
    assert unknown > 2.0 * known
