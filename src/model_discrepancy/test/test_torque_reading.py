"""The torque that moves a servo which gives way is the one that acts, not the one that is read."""

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ankle_physics.model import Model
from ankle_physics.term import term_library
from ankle_physics.virtual_rig import simulate
from model_discrepancy.diagnose import diagnose
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.problem import better_reading, prepare
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.spectrum import band
from model_discrepancy.recording.torque_reading import TorqueReading, sensor_response
from model_discrepancy.tools.open_set import OpenSet
from model_discrepancy.tools.recording_judgement import judge_alone
from model_discrepancy.tools.several_recordings import diagnose_together
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings

RATE = 1024.0
MODE = {"frequency": 62.0, "damping": 0.1}
SEARCHED_AGAIN = "what the torque sensor does is known better now: searching again"
CORE = {"inertia": {"I": 0.0137}, "viscosity": {}, "stiffness": {"K": 100.0}, "reflex": {"G": 8.0}}


@pytest.mark.parametrize(
    "values",
    [
        {"torque_sensor_mode": MODE},
        {"torque_sensor_lag": {"T": 0.003}},
        {"partial_sensor_mode": {**MODE, "share": 0.6}, "channel_skew": {"skew": 0.004}},
    ],
)
def test_what_the_sensor_does_is_undone(values):
    acted = band(np.random.default_rng(1).normal(size=20_000), RATE, 1.0, 50.0)
    frequency = np.fft.rfftfreq(len(acted), 1.0 / RATE)
    reading = TorqueReading.of({"inertia": {"I": 0.01}, **values})
    gain = np.exp(-2j * np.pi * frequency * reading.late)
    for entry in Model.of(values).entries:
        if entry.term.name != "channel_skew":
            gain = gain * entry.term.response(frequency, values[entry.term.name])
    read = np.fft.irfft(gain * np.fft.rfft(acted), len(acted))
    inside = slice(2000, -2000)
    error = (reading.acting(read, RATE) - acted)[inside]
    assert np.std(error) < 0.08 * np.std(acted)
    assert np.std((read - acted)[inside]) > 0.2 * np.std(acted)


def test_without_a_sensor_torque_acts_as_it_is_read():
    torque = np.random.default_rng(2).normal(size=1000)
    assert TorqueReading().acting(torque, RATE) is torque


def test_a_sensor_that_states_no_response_is_refused_by_name():
    term = term_library()["torque_sensor_lag"]()
    term.response = lambda *_: None
    with pytest.raises(DiagnosisError, match=r"torque_sensor_lag .* states no frequency response"):
        sensor_response(term, np.zeros(1), {"T": 0.003})


@pytest.fixture(scope="module")
def ringing():
    """A sensor that rings, on a servo of 1500 N.m/rad."""
    reference = PulseStep(Settings(rate=RATE)).next(round(40.0 * RATE))
    hidden = {"torque_sensor_mode": MODE, "servo_compliance": {"k_a": 1500.0}}
    model = Model.of({**CORE, **hidden, "voluntary_torque": {}})
    made = simulate(reference, RATE, model, seed=1)
    return Recording(
        RATE, made.position, made.torque, made.velocity, reference[:, 0], name="ringing"
    )


@pytest.mark.slow
def test_a_mode_of_the_sensor_moves_no_plate(ringing):
    left = []
    for reading in (None, TorqueReading(sensor={"torque_sensor_mode": MODE})):
        problem = prepare(ringing, reading=reading)
        terms = [*problem.base.terms, "torque_sensor_mode"]
        fit = problem.fitter.fit(terms, {**problem.base.values, "torque_sensor_mode": MODE})
        left.append(problem.predicted(fit))
        told = better_reading(problem, fit)
        assert (told is None) == bool(problem.reading.sensor)
        assert told is None or told.sensor.keys() == {"torque_sensor_mode"}
    assert better_reading(prepare(ringing), problem.base) is None
    assert left[0] > left[1] + 0.03


@pytest.mark.parametrize(("names", "many", "asked"), [(1, False, 1), (0, False, 0), (6, True, 0)])
def test_many_terms_tell_nothing_of_the_sensor(monkeypatch, names, many, asked):
    said = []
    # The package's name for it is the function.
    diagnosing = sys.modules["model_discrepancy.diagnose"]
    monkeypatch.setattr(diagnosing, "better_reading", lambda *_: said.append(True))
    found = SimpleNamespace(effects=[None] * names, needs_many_terms=many, final=None)
    assert diagnosing._told_reading(None, found) is None
    assert len(said) == asked


@pytest.mark.slow
def test_a_mode_of_the_sensor_on_a_servo_that_gives_way_is_named(ringing):
    library = ["torque_sensor_mode", "partial_sensor_mode", "channel_skew"]
    found = diagnose(ringing, library=library)
    assert [effect["name"] for effect in found.verdict.effects] == ["torque_sensor_mode"]
    values = found.found.final.values["torque_sensor_mode"]
    assert values["frequency"] == pytest.approx(MODE["frequency"], rel=0.01)
    assert found.problem.reading.sensor


@pytest.mark.slow
def test_several_recordings_know_what_the_sensor_does_once_it_is_found(ringing, monkeypatch):
    """What one of them tells serves the next one, too, and is not asked again."""
    visits = [ringing, replace(ringing, name="again")]
    library = ["torque_sensor_mode", "partial_sensor_mode", "channel_skew"]
    said = []
    found = diagnose_together(visits, library, said.append)
    assert [effect.name for effect in found.named] == ["torque_sensor_mode"]
    assert all(member.problem.reading.sensor for member in found.members)
    assert SEARCHED_AGAIN in said
    said.clear()
    known = found.members[0].problem.reading
    assert diagnose_together(visits, library, said.append, reading=known).members
    assert SEARCHED_AGAIN not in said


@pytest.mark.slow
def test_a_further_recording_is_judged_with_the_sensor_of_the_first(ringing):
    known = prepare(ringing, reading=TorqueReading(sensor={"torque_sensor_mode": MODE}))
    model = {**known.base.values, "torque_sensor_mode": MODE}
    left = []
    for first in (None, known):
        one = OpenSet("torque_sensor_mode", {"torque_sensor_mode": model})
        judge_alone([one], ringing, None, first)
        left.append(one.errors["torque_sensor_mode"][0].mean())
    assert left[1] < 0.98 * left[0]
