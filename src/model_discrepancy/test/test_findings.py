"""What the signals show without a fit: gains and lags of channels, tremor, lines, and responses
that vary.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfilt, sosfiltfilt

from ankle_physics.memory_elements import BacklashOperator
from ankle_physics.model import PAPER_TERMS, Model
from ankle_physics.signals import Signals
from model_discrepancy.criticism.locate import Cell, ResidualMap
from model_discrepancy.criticism.variability import LEAST_VARIATION, variability
from model_discrepancy.fit.base_model import fit_base, is_alignment
from model_discrepancy.fit.columns import Columns
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.movements import Onsets, find_onsets
from model_discrepancy.fit.rows import LOW_PASS_HZ, Rows
from model_discrepancy.problem import prepare
from model_discrepancy.recording.channel_gains import channel_findings, trusted
from model_discrepancy.recording.motion import motion_of, motion_step
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.resolution import coarse_step
from model_discrepancy.recording.servo import identify_servo
from simulation_study.planted_trials import simulate_trial


@pytest.fixture(scope="module")
def equal_steps():
    return simulate_trial({}, seed=2, duration=40.0, protocol="equal")


def found_in(recording, limit=LOW_PASS_HZ):
    motion = motion_of(recording)
    fitter = Fitter.of(motion, limit)
    base = fit_base(fitter)
    return variability(fitter, base, recording.torque)


def servo_of(recording):
    return identify_servo(recording, motion_step(recording))


def test_nothing_is_found_in_a_clean_recording(equal_steps):
    assert channel_findings(equal_steps) == []
    found = found_in(equal_steps)
    assert found.tremor is None
    assert found.unusual == []


def test_tremor_is_named_with_frequency_and_size(equal_steps):
    t = equal_steps.time
    drift = (
        0.4
        * np.cumsum(np.random.default_rng(0).standard_normal(len(t)))
        / np.sqrt(equal_steps.rate)
    )
    tremor = 0.3 * np.sin(2 * np.pi * 9.0 * t + drift)
    found = found_in(replace(equal_steps, torque=equal_steps.torque + tremor))
    assert found.tremor[0][0] == pytest.approx(9.0, abs=0.5)
    assert found.tremor[1][0] == pytest.approx(0.3 / np.sqrt(2.0), rel=0.25)


def test_a_line_is_no_tremor(equal_steps):
    found = found_in(
        replace(
            equal_steps,
            torque=equal_steps.torque + 0.2 * np.sin(2 * np.pi * 50.0 * equal_steps.time),
        )
    )
    assert found.tremor is None
    assert found.line_hz == pytest.approx(50.0, abs=0.5)


def test_a_weak_line_between_two_points_of_the_periodogram_is_found(equal_steps):
    line = 0.04 * np.sin(2 * np.pi * 50.25 * equal_steps.time)
    found = found_in(replace(equal_steps, torque=equal_steps.torque + line))
    assert found.line_hz == pytest.approx(50.25, abs=0.3)


def test_a_line_above_the_band_of_the_fit_is_judged_by_its_size_in_the_torque(equal_steps):
    for size, expected in ((0.1, pytest.approx(50.0, abs=0.5)), (0.02, None)):
        line = size * np.sin(2 * np.pi * 50.0 * equal_steps.time)
        recording = replace(equal_steps, torque=equal_steps.torque + line)
        assert found_in(recording, limit=28.0).line_hz == expected


def test_a_hump_is_no_line(equal_steps):
    noise = np.random.default_rng(4).standard_normal(len(equal_steps.torque))
    band = butter(1, (49.0, 51.0), "bandpass", fs=equal_steps.rate, output="sos")
    hump = sosfilt(band, noise)
    hump *= 0.2 / np.std(hump)
    found = found_in(replace(equal_steps, torque=equal_steps.torque + hump))
    assert found.line_hz is None


def test_lines_that_a_sum_of_sines_makes_are_no_tremor_and_no_pick_up():
    rate, frequencies = 1024.0, np.array([0.3, 0.7, 1.9, 4.3, 7.1, 11.9])
    t = np.arange(int(40.0 * rate)) / rate
    turns = 2.0 * np.pi * frequencies[:, None] * t + np.arange(6)[:, None]
    angle = 0.004 * np.sin(turns).sum(axis=0)
    velocity = 0.004 * (2.0 * np.pi * frequencies) @ np.cos(turns)
    signals = Signals(rate, angle, velocity, np.gradient(velocity) * rate)
    noise = np.random.default_rng(6).standard_normal((2, len(t)))
    torque = Model.of({term: {} for term in PAPER_TERMS}).torque(signals) + 0.02 * noise[0]
    not_modelled = 40.0 * np.maximum(velocity, 0.0) ** 3
    made = Recording(rate, angle + 1e-5 * noise[1], torque + not_modelled)
    found = found_in(made)
    assert found.line_hz is None
    assert found.tremor is None
    line = 0.2 * np.sin(2.0 * np.pi * 50.25 * t)
    found = found_in(replace(made, torque=made.torque + line))
    assert found.line_hz == pytest.approx(50.25, abs=0.3)


def test_torque_in_coarse_steps_is_seen_and_nothing_else(equal_steps):
    step = 0.35  # N.m; the noise that a converter adds is a tenth of that here
    noise = 0.035 * np.random.default_rng(3).standard_normal(len(equal_steps.torque))
    coarse = step * np.round(equal_steps.torque / step) + noise
    assert coarse_step(coarse) == pytest.approx(step, rel=0.02)
    found = found_in(replace(equal_steps, torque=coarse))
    assert "steps of 0.35 N.m" in found.unexplainable[0]
    assert coarse_step(equal_steps.torque) == 0.0
    assert coarse_step(equal_steps.position) == 0.0
    assert coarse_step(np.ones(100)) == 0.0
    assert coarse_step(np.r_[np.zeros(10_000), 5.0]) == 0.0


def test_responses_that_vary_at_random_are_seen(equal_steps):
    random = np.random.default_rng(1)
    motion = motion_of(equal_steps)
    times = find_onsets(Columns(motion, Rows(len(motion.position), motion.rate))).time
    burst = np.zeros(len(equal_steps.torque))
    for time in times[random.random(len(times)) < 0.3]:
        start = int(time * equal_steps.rate)
        burst[start : start + int(0.06 * equal_steps.rate)] += random.choice([-2.0, 2.0])
    found = found_in(replace(equal_steps, torque=equal_steps.torque + burst))
    assert found.variation > LEAST_VARIATION
    assert found.window[0] < 0.12
    assert "from one movement to the next" in found.unusual[0]


def test_a_wrong_gain_of_position_is_one_finding(equal_steps):
    reference = equal_steps.position
    recording = replace(equal_steps, position=1.1 * equal_steps.position, reference=reference)
    assert [f.name for f in channel_findings(recording, servo_of(recording))] == ["position_gain"]
    velocity = replace(equal_steps, velocity=1.1 * equal_steps.velocity, reference=reference)
    assert [f.name for f in channel_findings(velocity, servo_of(velocity))] == ["velocity_gain"]
    (ambiguous,) = channel_findings(replace(velocity, reference=None))
    assert ambiguous.name == "channel_gain"
    assert ambiguous.siblings == ("velocity_gain", "position_gain")


def test_channels_apart_by_less_than_half_a_sample_are_aligned_and_not_a_finding():
    recording = simulate_trial({"channel_skew": {"skew": 0.00015}}, seed=4, duration=40.0)
    problem = prepare(recording)
    base = problem.base
    assert is_alignment(problem.fitter, base)
    assert base.values["channel_skew"]["skew"] == pytest.approx(0.00015, abs=0.00003)


def test_play_of_the_encoder_is_one_finding_and_is_taken_out(equal_steps):
    read = BacklashOperator().run(equal_steps.position, 0.003)
    recording = replace(equal_steps, position=read)
    (finding,) = channel_findings(recording)
    assert finding.name == "backlash"
    assert finding.parameters["gap[rad]"][0] == pytest.approx(0.003, rel=0.05)
    error = trusted(recording, [finding]).position - equal_steps.position
    assert np.std(error) < 0.5 * np.std(read - equal_steps.position)


@pytest.mark.parametrize(
    ("gap", "gain", "expected"),
    [
        (0.009, 1.0, ["backlash"]),  # a gain leaves little more beside the integrated noise
        (0.0, 1.3, ["channel_gain"]),
        (0.0, 1.0, []),
    ],
)
def test_large_backlash_is_no_gain_though_the_velocity_is_noisy(gap, gain, expected):
    rate, random = 500.0, np.random.default_rng(3)
    targets = np.repeat(random.choice([-0.012, 0.012], 200), 150)
    moved = sosfiltfilt(butter(2, 8.0, fs=rate, output="sos"), targets)
    velocity = gain * np.gradient(moved) * rate + random.normal(0.0, 0.14, moved.size)
    read = BacklashOperator().run(moved, gap) if gap else moved
    found = channel_findings(Recording(rate, read, np.zeros_like(read), velocity))
    assert [finding.name for finding in found] == expected


def test_a_map_without_movements_says_that_nothing_was_seen():
    nothing = np.zeros(0)
    seen = ResidualMap(
        Onsets(nothing, nothing, nothing), [], {(0.5, 3.0): 0.1}, {}, {}, 0.5, (nothing,) * 3
    ).summary("intrinsic")
    for key in ("window_s", "direction", "symmetry", "depends_on"):
        assert seen[key] == "not seen"
    assert seen["band_hz"] == [0.5, 3.0]


def test_a_map_with_a_clear_response_says_when_and_in_which_direction():
    cells = [
        Cell(direction, "all", (0.04, 0.12), mean, mean - 0.1, mean + 0.1, 0.3)
        for direction, mean in (("up", 0.8), ("down", 0.02))
    ]
    nothing = np.zeros(0)
    seen = ResidualMap(
        Onsets(nothing, nothing, nothing), cells, {(0.5, 3.0): 0.1}, {}, {}, 0.5, (nothing,) * 3
    ).summary("reflex dynamics")
    assert seen["window_s"] == [0.04, 0.12]
    assert seen["direction"] == "dorsiflexion"
    assert seen["symmetry"] == "mixed"
