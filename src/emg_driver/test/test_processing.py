"""Background and reflex from EMG whose truth is known; bad samples, gaps, onset sources, bags."""

import numpy as np
import pytest

from ankle_interfaces.block import Block
from ankle_interfaces.errors import QuantityError
from emg_driver.backlog import Backlog
from emg_driver.electrode_quality import defects
from emg_driver.muscles import RESPONSE_COLUMNS, RESPONSE_TOPIC, SAMPLE_COLUMNS, SAMPLES_TOPIC
from emg_driver.offline import REFERENCE_TOPIC, respond_bag
from emg_driver.processor import EmgProcessor
from emg_driver.rectification import Rectifier
from emg_driver.reflex_response import respond
from emg_driver.settings import ElectrodeSettings, Settings
from emg_driver.stretch_onsets import REFERENCE_REST, OnsetDetector
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings as PerturbationSettings
from session_recorder.bag_reader import BagReader
from session_recorder.bag_writer import BagWriter
from session_recorder.errors import BagError

RATE = 2048
SECONDS = 12
START = 1000.0


@pytest.fixture(scope="module")
def recording():
    """Reference, its onsets, and EMG: 10 uV noise, three times as much 40 to 60 ms after the onsets
    that stretch each muscle.
    """
    signal = PulseStep(PerturbationSettings(rate=RATE, seed=4))
    reference = signal.next(SECONDS * RATE)
    time = START + np.arange(len(reference)) / RATE
    emg = 10e-6 * np.random.default_rng(1).standard_normal((len(time), 4))
    for onset in signal.onsets():
        burst = (time >= START + onset.time + 0.040) & (time < START + onset.time + 0.060)
        stretched = [0, 2, 3] if onset.direction > 0 else [1]
        emg[np.ix_(burst, stretched)] *= 3.0
    return time, reference[:, 0], emg, signal.onsets()


def process(time, position, emg, size=32, settings=None, velocity=None):
    processor = EmgProcessor(settings)
    parts = []
    for k in range(0, len(time), size):
        piece = slice(k, k + size)
        if position is not None:
            parts.append(processor.feed_reference(time[piece], position[piece]))
        if velocity is not None:
            parts.append(processor.feed_motion(time[piece], velocity[piece]))
        parts.append(processor.feed_emg(time[piece], emg[piece]))
    parts.append(processor.finish())
    return (
        np.concatenate([part.rows for part in parts]),
        [note for part in parts for note in part.notes],
        processor,
    )


def test_area_and_background_of_a_known_curve():
    time = np.arange(-0.1, 0.1, 0.0005)
    rectified = np.full((len(time), 1), 2e-6)
    rectified[(time >= 0.0399) & (time < 0.0599)] = 5e-6
    background, reflex = respond(time, rectified, 2000.0, 0.0, Settings())
    assert background == pytest.approx([2e-6])
    assert reflex == pytest.approx([3e-6 * 0.020])


def test_every_onset_gives_its_background_and_the_reflex_of_the_stretched_muscles(recording):
    time, position, emg, onsets = recording
    rows, _, processor = process(time, position, emg)
    inside = [onset for onset in onsets if onset.time < SECONDS - 0.1]
    assert len(rows) >= len(inside)
    assert (
        np.abs(rows[: len(inside), 0] - START - [onset.time for onset in inside]).max() <= 1 / RATE
    )
    assert rows[: len(inside), 1].tolist() == [onset.direction for onset in inside]
    mean_of_noise = 10e-6 * np.sqrt(2 / np.pi)
    later = rows[rows[:, 0] > START + 1.0]
    assert np.nanmean(later[:, 2:6]) == pytest.approx(mean_of_noise, rel=0.1)
    own = {1: [6, 8, 9], -1: [7]}
    for direction, columns in own.items():
        reflex = later[later[:, 1] == direction][:, columns].mean(axis=0)
        assert reflex == pytest.approx([2 * mean_of_noise * 0.020] * len(columns), rel=0.2)
    ensemble = processor.ensemble()
    during = (ensemble[:, 0] >= 0.042) & (ensemble[:, 0] < 0.058)
    assert (
        ensemble[during, 1:].mean(axis=0) > 2 * ensemble[ensemble[:, 0] < 0.0, 1:].mean(axis=0)
    ).all()


def test_the_result_does_not_depend_on_how_samples_are_split(recording):
    time, position, emg, _ = recording
    whole, _, _ = process(time, position, emg, size=4096)
    for size in (32, 77):
        rows, _, _ = process(time, position, emg, size=size)
        np.testing.assert_array_equal(rows, whole)


def test_measured_velocity_takes_over_where_there_is_no_reference(recording):
    time, position, emg, _ = recording
    velocity = np.gradient(position, 1 / RATE) + 0.006 * np.random.default_rng(2).standard_normal(
        len(time)
    )
    from_reference, _, _ = process(time, position, emg)
    alone, _, _ = process(time, None, emg, velocity=velocity)
    both, _, _ = process(time, position, emg, velocity=velocity)
    # The plate follows at once here, so both see the same onsets.
    assert len(both) == len(from_reference)
    assert np.abs(both[:, 0] - from_reference[:, 0]).max() < 0.002
    count = min(len(alone), len(from_reference) - 1)
    assert abs(len(alone) - len(from_reference)) <= 1
    # The very first movement begins with the recording; measured velocity has seen no rest before
    # it.
    offset = (
        from_reference[len(from_reference) - len(alone) :, 0] - alone[:, 0]
        if len(alone) < len(from_reference)
        else None
    )
    assert count > 30
    assert offset is None or np.abs(offset).max() < 0.005


def test_windows_start_when_the_plate_moves_and_the_lag_is_reported(recording):
    time, position, emg, _ = recording
    lag = 0.007
    delayed = np.interp(time - lag, time, position)
    velocity = np.gradient(delayed, 1 / RATE)
    velocity += 0.006 * np.random.default_rng(2).standard_normal(len(time))
    commanded, _, _ = process(time, position, emg)
    moved, _, processor = process(time, position, emg, velocity=velocity)
    assert processor.lag == pytest.approx(lag, abs=0.001)
    assert processor.unconfirmed <= 1
    later = moved[moved[:, 0] > START + 1.0]
    at_command = commanded[commanded[:, 0] > START + 1.0]
    assert np.median(later[:, 0] - at_command[: len(later), 0]) == pytest.approx(lag, abs=0.001)
    # The burst is tied to the command in this recording: the later window misses a part of it.
    assert np.nanmean(later[later[:, 1] > 0, 6]) < np.nanmean(at_command[at_command[:, 1] > 0, 6])
    for size in (32, 77):
        split, _, _ = process(time, position, emg, velocity=velocity, size=size)
        np.testing.assert_array_equal(split, moved)
    fixed, _, _ = process(
        time, position, emg, velocity=velocity, settings=Settings(onset_source="reference")
    )
    np.testing.assert_array_equal(fixed, commanded)


def test_a_plate_that_stands_still_answers_no_command(recording):
    """The rig is stopped in the second half, and the commands go on."""
    time, position, emg, _ = recording
    middle = START + 0.5 * (time[-1] - START)
    velocity = np.gradient(np.interp(time - 0.007, time, position), 1 / RATE)
    noise = 0.006 * np.random.default_rng(2).standard_normal(len(time))
    every, _, _ = process(time, position, emg, velocity=velocity + noise)
    still = np.where(time < middle, velocity, 0.0) + noise
    rows, _, processor = process(time, position, emg, velocity=still)
    assert rows[:, 0].max() < middle + 0.05
    np.testing.assert_array_equal(rows, every[: len(rows)])
    # The last command is too late for a window in either.
    assert len(rows) + processor.motionless in (len(every), len(every) + 1)
    for size in (32, 77):
        split, _, _ = process(time, position, emg, velocity=still, size=size)
        np.testing.assert_array_equal(split, rows)
    # Where the motion was not measured, nothing says that the plate stood still.
    lost = np.where(time < middle, still, np.nan)
    unseen, _, processor = process(time, position, emg, velocity=lost)
    assert len(unseen) == len(every)
    assert processor.motionless == 0


def test_a_servo_that_overshoots_makes_no_onset():
    time = np.arange(4000) / 2000.0
    position = 0.04 * (1 - np.exp(-130 * (time - 1)) * np.cos(60 * (time - 1))) * (time > 1)
    detector = OnsetDetector(0.05, 0.3)
    found = detector.from_velocity(time, np.gradient(position, time))
    assert found[:, 1].tolist() == [1.0]
    assert found[0, 0] == pytest.approx(1.0, abs=0.002)


def test_half_a_movement_behind_a_gap_is_no_onset():
    time = np.concatenate([np.arange(100), 200 + np.arange(100)]) / 2000.0
    velocity = np.concatenate([np.zeros(100), np.full(100, 1.0)])
    assert len(OnsetDetector(REFERENCE_REST, 0.3).from_velocity(time, velocity)) == 0


def test_a_nan_never_reaches_later_responses(recording):
    time, position, emg, _ = recording
    damaged = emg.copy()
    damaged[5 * RATE : 5 * RATE + 3, 1] = np.nan
    good, _, _ = process(time, position, emg)
    rows, notes, _ = process(time, position, damaged)
    assert "TA: 3 of 2048 samples are NaN or infinite" in notes
    bad = np.isnan(rows[:, 3])
    when = rows[bad & ~np.isnan(good[:, 3]), 0] - START
    assert when.min() > 4.9
    assert when.max() < 6.0
    np.testing.assert_array_equal(rows[:, [2, 4, 5, 6, 8, 9]], good[:, [2, 4, 5, 6, 8, 9]])
    after = rows[:, 0] > START + 6.1
    np.testing.assert_allclose(rows[after], good[after], rtol=1e-6)


def test_a_gap_gives_no_response_and_is_said(recording):
    time, position, emg, _ = recording
    keep = np.ones(len(time), dtype=bool)
    keep[5 * RATE : 5 * RATE + 500] = False
    processor = EmgProcessor()
    processor.feed_reference(time, position)
    due = [
        processor.feed_emg(time[keep][k : k + 32], emg[keep][k : k + 32])
        for k in range(0, keep.sum(), 32)
    ]
    rows = np.concatenate([one.rows for one in due])
    near = (rows[:, 0] > START + 4.95) & (rows[:, 0] < START + 5.6)
    assert near.any()
    assert np.isnan(rows[near, 2:]).all()
    assert any("without a gap" in note for one in due for note in one.notes)
    assert np.isfinite(rows[rows[:, 0] > START + 6.3, 2:]).all()


def test_time_that_runs_back_is_said_and_forgotten(recording):
    time, _, emg, _ = recording
    processor = EmgProcessor()
    processor.feed_emg(time[: 4 * RATE], emg[: 4 * RATE])
    due = processor.feed_emg(time[: 2 * RATE], emg[: 2 * RATE])
    assert "EMG: time runs back" in due.notes[0]


def test_a_backlog_never_overruns_a_reader_that_keeps_64_blocks():
    backlog = Backlog()
    backlog.add(np.full((1, 1), k) for k in range(200))
    given = [backlog.due(0.0)]
    for k in range(1, 1000):
        if k % 4 == 0:
            backlog.add([np.full((1, 1), 199 + k // 4)])
        given.append(backlog.due(k / 256))
    counts = np.array([len(some) for some in given])
    assert counts.max() <= 16
    # What a reader has to take within any quarter of a second.
    assert np.convolve(counts, np.ones(64), "valid").max() <= 16 + 32 + 1
    assert len(backlog) == 0
    assert [int(block[0, 0]) for some in given for block in some] == list(range(449))


def test_too_slow_a_stream_is_refused():
    with pytest.raises(ValueError, match=r"EMG comes at 500 Hz; at least 1000 Hz"):
        EmgProcessor().feed_emg(np.arange(300) / 500.0, np.zeros((300, 4)))


@pytest.mark.parametrize(
    ("kind", "change"),
    [
        ("flat", lambda e, t: np.where((t > 0.5) & (t < 0.56), 1e-5, e)),
        ("saturated", lambda e, t: np.clip(8 * e, -2e-4, 2e-4)),
        ("hum", lambda e, t: e + 3e-5 * np.sin(2 * np.pi * 50.0 * t)),
        ("too_large", lambda e, t: 1e3 * e),
        ("not_finite", lambda e, t: np.where(t == t[7], np.inf, e)),
    ],
)
def test_bad_electrodes_are_told_from_good_ones(kind, change):
    time = np.arange(RATE) / RATE
    emg = 2e-5 * np.random.default_rng(5).standard_normal((RATE, 2))
    emg[:, 1] = change(emg[:, 1], time)
    good, bad = defects(emg, RATE, ElectrodeSettings())
    assert good is None
    assert bad is not None
    assert bad.kind == kind


def test_contractions_and_bursts_are_no_defect():
    time = np.arange(RATE) / RATE
    emg = 2e-6 * np.random.default_rng(6).standard_normal((RATE, 1))
    emg[(time > 0.3) & (time < 0.32)] *= 200.0
    assert defects(emg, RATE, ElectrodeSettings()) == [None]


def test_highpass_passes_emg_and_stops_movement():
    time = np.arange(4 * RATE) / RATE
    signal = np.column_stack([np.sin(2 * np.pi * 100 * time), np.sin(2 * np.pi * 2 * time)]) + 5.0
    out = Rectifier(RATE, 2, 20.0, 2).highpass(signal)[RATE:]
    assert np.std(out, axis=0) == pytest.approx([np.sqrt(0.5), 0.0], abs=0.02)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (
            {"highpass_cutoff": 500.0},
            "'highpass_cutoff' = 500.0 Hz is refused; allowed: 1 to 200 Hz",
        ),
        (
            {"reflex_start": 0.07},
            "'reflex_end' = 0.06 s is refused; allowed: after 'reflex_start' = 0.07 s",
        ),
        ({"rest_velocity": 0.5}, "allowed: below 'onset_velocity'"),
    ],
)
def test_settings_out_of_range_are_refused(values, words):
    with pytest.raises(QuantityError) as refused:
        Settings(**values)
    assert words in str(refused.value)


def test_a_bag_gives_the_same_numbers(recording, tmp_path):
    time, position, emg, _ = recording
    expected, _, _ = process(time, position, emg)
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic(REFERENCE_TOPIC)
        writer.add_topic(SAMPLES_TOPIC)
        for k in range(0, len(time), 32):
            piece = slice(k, k + 32)
            writer.write_block(
                REFERENCE_TOPIC,
                Block(("t[s]", "position[rad]"), np.column_stack([time[piece], position[piece]])),
            )
            microvolts = tuple(name.replace("[V]", "[uV]") for name in SAMPLE_COLUMNS)
            writer.write_block(
                SAMPLES_TOPIC, Block(microvolts, np.column_stack([time[piece], 1e6 * emg[piece]]))
            )
    found = respond_bag(tmp_path / "bag", tmp_path / "responses")
    np.testing.assert_allclose(found.rows, expected, rtol=1e-9)
    columns, written = BagReader(tmp_path / "responses").signal(RESPONSE_TOPIC)
    assert columns == RESPONSE_COLUMNS
    np.testing.assert_array_equal(written, found.rows)


def test_a_bag_without_emg_or_without_onsets_is_refused(tmp_path):
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic(SAMPLES_TOPIC)
    with pytest.raises(BagError, match="no onset to look at"):
        respond_bag(tmp_path / "bag")
    with BagWriter(tmp_path / "other") as writer:
        writer.add_topic(REFERENCE_TOPIC)
    with pytest.raises(BagError, match="has no topic '/emg/samples'"):
        respond_bag(tmp_path / "other")
