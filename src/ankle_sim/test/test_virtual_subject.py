"""A simulated subject: what states do to joint and electrodes, in blocks of any size."""

from itertools import pairwise

import numpy as np
import pytest

from ankle_physics.actuator import Servo
from ankle_physics.errors import ModelError
from ankle_physics.scenario import Scenario
from ankle_physics.sensors import SignalToNoise
from ankle_physics.surface_emg import Electrodes, SurfaceEmg
from ankle_sim.live_rig import Setup
from ankle_sim.live_subject import LiveSubject, subject_model
from ankle_sim.procedure import PAPER_HOLDS, plan, some_holds
from ankle_sim.virtual_subject import State, VirtualSubject, draw_subject
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings

RATE = 2048


def mean_drive(state, holds=200):
    subject = VirtualSubject(draw_subject(1), 5)
    drives = [subject.command(state) for _ in range(holds)]
    return {
        name: np.mean([getattr(drive, name) for drive in drives], axis=0)
        for name in ("K", "G", "background", "burst")
    }


def test_stiffness_saturates_with_cocontraction_and_background_does_not():
    rest, half, full = (mean_drive(State(c, 0.5)) for c in (0.0, 0.5, 1.0))
    assert rest["K"] == pytest.approx(draw_subject(1).K_rest, rel=0.02)
    assert half["K"] - rest["K"] > 2 * (full["K"] - half["K"])
    added = half["background"] - rest["background"]
    assert ((full["background"] - half["background"]) > 0.8 * added).all()


def test_excitability_sets_gain_and_bursts_of_the_calf_and_leaves_stiffness():
    low, high = (mean_drive(State(0.3, e)) for e in (0.2, 0.8))
    assert high["G"] / low["G"] == pytest.approx(4.0, rel=0.1)
    assert (high["burst"] / low["burst"])[[0, 2, 3]] == pytest.approx([4.0] * 3, rel=0.15)
    assert 1.0 < (high["burst"] / low["burst"])[1] < 3.0
    assert high["K"] == pytest.approx(low["K"], rel=0.03)


def test_a_push_is_measured_as_the_torque_that_holds_the_ankle():
    assert VirtualSubject(draw_subject(1), 1).command(State(push=5.0)).torque == 5.0
    pushed, free = mean_drive(State(0.2, 0.5, 5.0)), mean_drive(State(0.2, 0.5, 0.0))
    assert (pushed["background"] > free["background"])[[0, 2, 3]].all()
    assert pushed["background"][1] == pytest.approx(free["background"][1], rel=0.05)


def test_holds_of_the_same_state_differ_and_subjects_differ():
    subject = VirtualSubject(draw_subject(2), 3)
    first, second = subject.command(State()), subject.command(State())
    assert first.K != second.K
    assert (first.background != second.background).all()
    assert draw_subject(2).K_rest != draw_subject(3).K_rest
    np.testing.assert_array_equal(draw_subject(2).burst, draw_subject(2).burst)


def test_a_steady_subject_has_the_same_joint_in_every_hold_and_another_mixture_of_muscles():
    subject = VirtualSubject(draw_subject(2), 3, steady=True)
    first, second = subject.command(State()), subject.command(State())
    np.testing.assert_allclose([first.K, first.G], [second.K, second.G])
    assert (first.background != second.background).all()
    assert (first.burst != second.burst).all()


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"cocontraction": 1.2}, "cocontraction = 1.2 is refused; allowed: 0 to 1"),
        ({"push": -30.0}, "-20 to 20 N.m"),
    ],
)
def test_states_out_of_range_are_refused(values, words):
    with pytest.raises(ValueError, match=words):
        State(**values)


def test_emg_is_the_same_in_blocks_of_any_size():
    velocity = PulseStep(Settings(rate=RATE)).next(3 * RATE)[:, 1]
    background, burst = np.full(4, 5e-6), np.full(4, 2e-5)
    whole = SurfaceEmg(RATE, 7).run(velocity, background, burst)
    emg = SurfaceEmg(RATE, 7)
    parts = np.concatenate(
        [emg.run(velocity[k : k + 100], background, burst) for k in range(0, len(velocity), 100)]
    )
    np.testing.assert_allclose(parts, whole, atol=1e-12)


def test_emg_has_the_spectrum_and_the_amplitude_that_were_asked_for():
    still = np.zeros(20 * RATE)
    emg = SurfaceEmg(RATE, 1, Electrodes(noise=0.0, hum=0.0, offset=0.0)).run(
        still, np.full(4, 2e-5), np.zeros(4)
    )
    assert emg.std(axis=0) == pytest.approx([2e-5] * 4, rel=0.1)
    power = np.abs(np.fft.rfft(emg[:, 0])) ** 2
    frequency = np.fft.rfftfreq(len(still), 1 / RATE)
    median = frequency[np.searchsorted(np.cumsum(power), 0.5 * power.sum())]
    assert 70 < median < 130


def test_bursts_follow_the_stretch_by_their_latency():
    signal = PulseStep(Settings(rate=RATE))
    velocity = signal.next(30 * RATE)[:, 1]
    emg = np.abs(SurfaceEmg(RATE, 1).run(velocity, np.full(4, 1e-6), np.full(4, 2e-5)) - 2e-4)
    onsets = [round(o.time * RATE) for o in signal.onsets() if o.direction > 0 and 1 < o.time < 29]
    wave = np.mean([emg[k : k + 250, 0] for k in onsets], axis=0)
    peak = int(np.argmax(np.convolve(wave, np.ones(10) / 10, "same"))) / RATE
    assert 0.040 < peak < 0.062
    assert (
        wave[round(0.045 * RATE) : round(0.06 * RATE)].mean()
        > 5 * wave[: round(0.03 * RATE)].mean()
    )


def test_the_papers_numbers_of_holds_fit_into_its_blocks():
    assert np.sum(PAPER_HOLDS, axis=0).tolist() == [33, 22]
    holds = plan(PAPER_HOLDS[0], 1)
    assert [hold.target for hold in holds].count(-5.0) == 7
    assert all(hold.end - hold.start == 60.0 for hold in holds)
    assert all(later.reach >= hold.end for hold, later in pairwise(holds))
    assert np.ptp([hold.state.cocontraction for hold in holds if hold.target == 0.0]) > 0.7
    still = plan(PAPER_HOLDS[0], 1, modulates=False)
    assert len({(hold.state.cocontraction, hold.state.excitability) for hold in still}) == 1


def test_a_session_says_when_holds_begin_and_end():
    subject = draw_subject(1)
    setup = Setup(subject_model(subject), Servo(), SignalToNoise(), Scenario([]), 0.04, 1)
    live = LiveSubject(setup, subject, some_holds(3, 1, 2.0, 1.0), lambda sentence: None)
    signal = PulseStep(Settings(rate=RATE))
    events, pieces = [], []
    for first in range(0, 10 * RATE, 256):
        piece, event = live.take(50.0 + np.arange(first, first + 256) / RATE, signal.next(256))
        events += event
        pieces += piece
    assert [event.event for event in events] == ["hold started", "hold ended"] * 3
    assert [event.time for event in events] == pytest.approx([51.0, 53.0, 54.0, 56.0, 57.0, 59.0])
    assert sorted(event.details["torque_target[N.m]"] for event in events[::2]) == [-5.0, 0.0, 0.0]
    assert sum(len(piece.emg) for piece in pieces) == 10 * RATE
    assert all(np.isfinite(piece.emg).all() for piece in pieces)


def test_a_value_set_by_hand_is_kept_until_the_next_state():
    setup = Setup(
        subject_model(draw_subject(1)), Servo(), SignalToNoise(), Scenario([]), 0.04, seed=1
    )
    live = LiveSubject(setup, draw_subject(1), [], lambda sentence: None, noisy=False)
    time = np.arange(64) / RATE
    live.take(time, np.zeros((64, 3)))
    live.fix("stiffness", "K", 120.0)
    for block in (1, 2):
        pieces, _ = live.take(time + block * 64 / RATE, np.zeros((64, 3)))
        assert pieces[-1].stretch.truth["stiffness.K[N.m/rad]"] == 120.0
    live.command(State(cocontraction=0.0))
    live.take(time + 3 * 64 / RATE, np.zeros((64, 3)))
    pieces, _ = live.take(time + 4 * 64 / RATE, np.zeros((64, 3)))
    assert pieces[-1].stretch.truth["stiffness.K[N.m/rad]"] == pytest.approx(live.drive.K, rel=0.01)
    with pytest.raises(ModelError, match="K' = 2000"):
        live.fix("stiffness", "K", 2000.0)
