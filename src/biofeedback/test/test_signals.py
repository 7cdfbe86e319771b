"""Cursor, voluntary torque, traces, freshness: what is on the screens is what was measured."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ankle_physics.actuator import Servo
from ankle_physics.scenario import Scenario
from ankle_physics.sensors import SignalToNoise
from ankle_sim.live_rig import Setup
from ankle_sim.live_subject import LiveSubject, subject_model
from ankle_sim.virtual_subject import State, draw_subject
from biofeedback.graph_health import GraphHealth
from biofeedback.live_signals import GOOD, INVALID, STALE, WAITING, LiveSignals
from biofeedback.muscle_activity import MuscleActivity
from biofeedback.voluntary_torque import VoluntaryTorque
from biofeedback.web.cursor import Cursor
from biofeedback.web.live_traces import MinMaxTraces
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings as PerturbationSettings

RATE = 2048.0


@settings(deadline=None)
@given(
    st.lists(st.floats(1e-4, 0.2), min_size=1, max_size=30),
    st.floats(-50.0, 50.0),
    st.floats(-50.0, 50.0),
)
def test_cursor_goes_to_a_step_without_overshoot_whatever_the_frames(steps, start, end):
    cursor, whole = Cursor(), Cursor()
    cursor.advance(np.array([start, 0.0]), 0.0)
    whole.advance(np.array([start, 0.0]), 0.0)
    for step in steps:
        x = cursor.advance(np.array([end, 0.0]), step)[0]
        assert min(start, end) - 1e-9 <= x <= max(start, end) + 1e-9
    # Exact for a target that stays: many frames or one, the same place.
    assert x == pytest.approx(whole.advance(np.array([end, 0.0]), sum(steps))[0], abs=1e-6)


def test_cursor_lags_a_ramp_by_its_time_constant():
    cursor, speed = Cursor(8.0), 3.0
    for k in range(3000):
        x = cursor.advance(np.array([speed * k * 1e-3, 0.0]), 1e-3)[0]
    lag = (speed * 2.999 - x) / speed
    assert lag == pytest.approx(2.0 / (2.0 * math.pi * 8.0), abs=1.5e-3)


def test_cursor_stays_where_nothing_is_known():
    cursor = Cursor()
    cursor.advance(np.array([4.0, 1.0]), 0.0)
    held = cursor.advance(np.array([np.nan, 3.0]), 0.5).copy()
    assert held[0] == 4.0
    assert held[1] == pytest.approx(3.0, abs=1e-3)


def test_subjects_torque_is_what_the_subject_pushes_not_what_the_perturbation_does():
    """Both with K and G of a real estimate's error: 5 %."""
    subject = draw_subject(1)
    setup = Setup(subject_model(subject, rms=0.0), Servo(), SignalToNoise(), Scenario([]), 0.04, 1)
    live = LiveSubject(setup, subject, [], lambda sentence: None)
    live.command(State(cocontraction=0.6, excitability=0.6, push=5.0))
    signal = PulseStep(PerturbationSettings(seed=3))
    plain, ours = VoluntaryTorque(), VoluntaryTorque()
    shown = []
    for k in range(0, int(40 * RATE), 32):
        pieces, _ = live.take(np.arange(k, k + 32) / RATE, signal.next(32))
        for piece in pieces:
            plain.feed(piece.stretch.samples, RATE, math.nan, math.nan)
            ours.feed(piece.stretch.samples, RATE, 1.05 * live.drive.K, 0.95 * live.drive.G)
        if k > 20 * RATE:
            shown.append((plain.value, ours.value))
    plain_values, our_values = np.array(shown).T
    assert np.abs(our_values + 5.0).max() < 0.5
    assert our_values.std() < 0.2 * plain_values.std()


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.integers(0, 4000), min_size=1, max_size=300),
    st.integers(1, 7),
    st.randoms(use_true_random=False),
)
def test_traces_keep_least_and_largest_of_every_bin(offsets, size, random):
    offsets = sorted(offsets)
    time = 1000.0 + np.array(offsets) * 1e-3
    values = np.array([[random.uniform(-5, 5), random.uniform(-5, 5)] for _ in offsets])
    traces = MinMaxTraces(("a", "b"), window=3.0, bins=30)
    for k in range(0, len(time), size):
        traces.feed(time[k : k + size], values[k : k + size])
    found = traces.since(None)
    last = int(np.floor(time[-1] / traces.width))
    bins = np.floor(time / traces.width).astype(int)
    for number in range(last - 29, last):
        inside = values[bins == number]
        low = found["low"]["a"][number - found["first"]]
        high = found["high"]["b"][number - found["first"]]
        if len(inside):
            assert low == pytest.approx(inside[:, 0].min(), rel=1e-3)
            assert high == pytest.approx(inside[:, 1].max(), rel=1e-3)
        else:
            assert low is None
            assert high is None


def test_traces_give_each_bin_once():
    traces = MinMaxTraces(("a",), window=1.0, bins=10)
    traces.feed(np.array([5.0, 5.05, 5.31]), np.array([[1.0], [2.0], [3.0]]))
    first = traces.since(None)
    seen = first["first"] + len(first["low"]["a"]) - 1
    assert traces.since(seen) is None
    traces.feed(np.array([5.52]), np.array([[7.0]]))
    assert traces.since(seen) == {
        "first": 53,
        "low": {"a": [3.0, None]},
        "high": {"a": [3.0, None]},
    }


def test_quality_of_what_is_shown():
    signals = LiveSignals()
    assert signals.snapshot(100.0, 0.0).quality == WAITING
    signals.feed_estimates(np.array([[100.0, 80.0, 8.0, 0.0]]), 0.0)
    found = signals.snapshot(100.1, 0.1)
    assert (found.quality, math.isnan(found.G)) == (INVALID, True)
    signals.feed_estimates(np.array([[100.2, 80.0, 8.0, 1.0]]), 0.2)
    assert signals.snapshot(100.3, 0.3).quality == GOOD
    assert signals.snapshot(100.75, 0.75).quality == STALE
    # It still arrives, but a reader that lags behind gives old values.
    signals.feed_estimates(np.array([[100.3, 80.0, 8.0, 1.0]]), 5.0)
    assert signals.snapshot(105.0, 5.0).quality == STALE


def test_recorder_is_known_by_its_figures_and_a_silent_node_is_shown():
    health = GraphHealth()
    assert health.recording(0.0) == {"on": False, "messages": None, "missing": None, "free": None}
    figures = {"ready": "True", "messages": "120", "missing samples": "3", "free disk [MB]": "5100"}
    health.feed("my_recorder", 0, "running", figures, 10.0)
    assert health.recording(11.0) == {"on": True, "messages": 120, "missing": 3, "free": 5100}
    assert health.recording(20.0)["on"] is False
    assert health.nodes(20.0)[0]["level"] == "silent"


def test_a_fault_is_reported_once():
    health = GraphHealth()
    for _ in range(3):
        health.feed("rig", 2, "emergency stop", {}, 1.0)
    assert health.new_faults() == [("rig", "emergency stop")]
    assert health.new_faults() == []


def test_activity_is_that_of_the_muscle_not_of_the_electrodes_offset():
    random = np.random.default_rng(3)
    activity = MuscleActivity(("SOL", "TA"))
    for _ in range(640):
        emg = random.standard_normal((32, 2)) * (2e-5, 1e-6) + 5e-3
        activity.feed(emg, 2048.0)
    # Of Gaussian noise, the mean of the absolute value is sqrt(2 / pi) of the rms.
    assert activity.values["SOL"] == pytest.approx(2e-5 * np.sqrt(2 / np.pi), rel=0.15)
    assert activity.values["TA"] == pytest.approx(1e-6 * np.sqrt(2 / np.pi), rel=0.15)
    activity.feed(np.full((32, 2), np.nan), 2048.0)
    assert activity.values["SOL"] == pytest.approx(2e-5 * np.sqrt(2 / np.pi), rel=0.15)


def test_doubt_is_said_in_the_estimators_words_as_long_as_there_is_any():
    signals = LiveSignals()
    said = {"estimate": "not valid: ", "model": "estimates are doubtful: "}
    signals.feed_status("estimator", 0, "running", said, 0.0)
    assert (signals.health.doubt(), signals.health.reason()) == ("", "")
    text = "estimates are doubtful: halves disagree; tissue relaxes"
    signals.feed_status("estimator", 1, text, said, 1.0)
    assert signals.describe(1.0)["doubt"] == "halves disagree"
    assert signals.health.reason() == ""
