"""Import: values in SI and in this project's signs, and refusal of what the data contradict."""

from pathlib import Path

import numpy as np
import pytest
from synthetic_ankle import STATED, I, K, synthetic

from ankle_interfaces.continuity import Continuity
from session_recorder.bag_reader import BagReader
from session_recorder.errors import BagError, ImportRefused
from session_recorder.exporting import export_bag
from session_recorder.importing import import_recording

RECORDINGS = Path(__file__).resolve().parents[4] / "shared" / "recordings"


@pytest.fixture
def write(tmp_path):
    def write(**changes):
        path = tmp_path / "recording.npz"
        np.savez(path, **{**synthetic(), **changes})
        return path

    return write


@pytest.fixture(scope="module")
def human():
    paths = sorted(RECORDINGS.glob("mcgill_*.npz"))
    if not paths:
        pytest.skip(f"no real recordings in {RECORDINGS}")
    return {path: dict(np.load(path)) for path in paths}


def test_synthetic_ankle_is_accepted_and_recovered(write, tmp_path):
    source = write()
    report = import_recording(
        source, tmp_path / "bag", {**STATED, "velocity[rad/s]": "velocity"}, torque_sign="rig"
    )
    assert report.warnings == ()
    assert report.rate == 1000.0
    assert report.intrinsic.inertia == pytest.approx(I, rel=0.1)
    assert report.intrinsic.stiffness == pytest.approx(K, rel=0.1)
    columns, data = BagReader(tmp_path / "bag").signal("/ankle/samples")
    assert columns == ("t[s]", "position[rad]", "torque[N.m]", "velocity[rad/s]")
    truth = np.load(source)
    assert np.array_equal(
        data,
        np.column_stack([truth["time"], truth["position"], truth["torque"], truth["velocity"]]),
    )


def test_units_and_sign_are_converted(write, tmp_path):
    truth = synthetic()
    source = write(
        position=np.degrees(truth["position"]),
        velocity=np.degrees(truth["velocity"]),
        torque=-1000 * truth["torque"],
        time=1000 * truth["time"],
        emg=1e6 * truth["torque"] * 1e-6,
    )
    stated = {
        "t[ms]": "time",
        "position[deg]": "position",
        "velocity[deg/s]": "velocity",
        "torque[mN.m]": "torque",
        "SOL[uV]": "emg",
        "reference_position[deg]": "position",
    }
    report = import_recording(source, tmp_path / "bag", stated, torque_sign="subject")
    assert report.warnings == ()
    reader = BagReader(tmp_path / "bag")
    columns, data = reader.signal("/ankle/samples")
    for name in ("position[rad]", "velocity[rad/s]", "torque[N.m]"):
        np.testing.assert_allclose(
            data[:, columns.index(name)], truth[name.split("[")[0]], rtol=1e-12, atol=1e-12
        )
    assert reader.signal("/emg/samples")[0] == ("t[s]", "SOL[V]")
    np.testing.assert_allclose(
        reader.signal("/emg/samples")[1][:, 1], 1e-6 * truth["torque"], rtol=1e-12
    )
    assert reader.signal("/perturbation/reference")[0] == ("t[s]", "position[rad]")
    assert reader.custom_data["stated_torque_sign"] == "subject"


def test_real_trials_are_imported_as_they_are(human, tmp_path):
    for number, (path, truth) in enumerate(human.items()):
        report = import_recording(path, tmp_path / str(number), STATED, torque_sign="subject")
        assert report.warnings == ()
        columns, data = BagReader(tmp_path / str(number)).signal("/ankle/samples")
        assert columns == ("t[s]", "position[rad]", "torque[N.m]")
        assert np.array_equal(
            data, np.column_stack([truth["time"], truth["position"], -truth["torque"]])
        )
        assert data[:, 1].mean() == pytest.approx(0.151, abs=0.002)
        assert not Continuity().check(data)


CONTRADICTIONS = {
    "wrong sign": ({}, {}, "rig", "sign is not 'rig'.*state 'subject'"),
    "degrees": (
        {"position": lambda d: np.degrees(d["position"])},
        {},
        "subject",
        "an ankle's range is 1.6 rad; is it in deg",
    ),
    "degrees without offset": (
        {
            "position": lambda d: 0.2 * np.degrees(d["position"] - d["position"].mean()),
            "torque": lambda d: 0.2 * d["torque"],
        },
        {},
        "subject",
        "units of position and torque do not fit.*position in degrees",
    ),
    "mN.m": (
        {"torque": lambda d: 1000 * d["torque"]},
        {},
        "subject",
        "torque reaches .* N.m.*is it in mN.m",
    ),
    "stated as mN.m": (
        {},
        {"torque[N.m]": None, "torque[mN.m]": "torque"},
        "subject",
        "units of position and torque do not fit",
    ),
    "stated as degrees": (
        {},
        {"position[rad]": None, "position[deg]": "position"},
        "subject",
        "position already in rad",
    ),
}


@pytest.mark.parametrize("case", CONTRADICTIONS)
def test_real_trials_with_wrong_statements_are_refused(human, tmp_path, case):
    changes, columns, sign, words = CONTRADICTIONS[case]
    stated = {name: column for name, column in {**STATED, **columns}.items() if column}
    for number, truth in enumerate(human.values()):
        source = tmp_path / f"{number}.npz"
        np.savez(source, **{**truth, **{name: change(truth) for name, change in changes.items()}})
        with pytest.raises(ImportRefused, match=words):
            import_recording(source, tmp_path / "bag", stated, torque_sign=sign)
        assert not (tmp_path / "bag").exists()


@pytest.mark.parametrize(
    ("change", "sign", "words"),
    [
        (lambda d: {"torque": -d["torque"]}, "rig", "sign is not 'rig'"),
        (lambda d: {}, "subject", "sign is not 'subject'.*state 'rig'"),
        (lambda d: {"velocity": -d["velocity"]}, "rig", "velocity has the opposite sign"),
        (
            lambda d: {"velocity": np.degrees(d["velocity"])},
            "rig",
            "velocity is 5[78].* times the derivative.*deg/s",
        ),
        (
            lambda d: {"velocity": d["velocity"][::-1]},
            "rig",
            "velocity does not follow the derivative",
        ),
        (
            lambda d: {"velocity": 1000 * d["velocity"]},
            "rig",
            "velocity reaches .* more than 40 rad/s is not possible",
        ),
        (
            lambda d: {"time": np.where(np.arange(20000) < 9000, d["time"], d["time"] - 5)},
            "rig",
            "time runs back by 5",
        ),
        (lambda d: {"time": 1000 * d["time"]}, "rig", "a rate of 1 Hz.*Is it in ms"),
        (lambda d: {"time": -d["time"]}, "rig", "time does not increase"),
        (lambda d: {"time": np.full(20000, np.nan)}, "rig", "do not tell a sampling rate"),
        (
            lambda d: {"position": d["position"][:-1]},
            "rig",
            "columns of different length: .*position 19999",
        ),
    ],
)
def test_contradictions_are_refused_with_the_reason(write, tmp_path, change, sign, words):
    source = write(**change(synthetic()))
    with pytest.raises(ImportRefused, match=words):
        import_recording(
            source, tmp_path / "bag", {**STATED, "velocity[rad/s]": "velocity"}, torque_sign=sign
        )
    assert not (tmp_path / "bag").exists()


def test_force_imports_and_keeps_the_warning(write, tmp_path):
    source = write()
    report = import_recording(source, tmp_path / "bag", STATED, torque_sign="subject", force=True)
    assert any("forced: the torque's sign" in warning for warning in report.warnings)
    reader = BagReader(tmp_path / "bag")
    assert "forced: the torque's sign" in reader.custom_data["warnings"]
    assert np.array_equal(reader.signal("/ankle/samples")[1][:, 2], -np.load(source)["torque"])


@pytest.mark.parametrize(
    ("columns", "options", "words"),
    [
        ({"position": "position"}, {"rate": 1000}, "does not say its unit"),
        ({"position[furlong]": "position"}, {"rate": 1000}, "unknown unit 'furlong'"),
        (
            {"position[N.m]": "position"},
            {"rate": 1000},
            r"position is given in 'N\.m', expected rad",
        ),
        ({"weight[N.m]": "position"}, {"rate": 1000}, "unknown quantity; known: t, position"),
        ({"position[rad]": "position"}, {}, "neither a sampling rate nor a time column"),
        (
            {"position[rad]": "position"},
            {"rate": -5},
            "sampling rate -5 Hz is refused; allowed: 50 to 100000 Hz",
        ),
        ({"t[s]": "time"}, {}, "no signal is stated"),
        ({"torque[N.m]": "torque"}, {"rate": 1000}, "the sign of torque is not stated"),
        (
            {"torque[N.m]": "torque"},
            {"rate": 1000, "torque_sign": "left"},
            "torque sign 'left' is not known",
        ),
        (
            {"position[rad]": "angle"},
            {"rate": 1000},
            "no column 'angle'; it holds time, position, velocity, torque",
        ),
        (
            {"position[rad]": "position", "position[deg]": "position"},
            {"rate": 1000},
            "stated twice",
        ),
        ({"position[rad]": "position"}, {"rate": 1000, "missing": "fill"}, "policy 'fill'"),
        (
            {"t[s]": "time", "position[rad]": "position"},
            {"rate": 1024},
            "is 1024 Hz, the time column steps at 1000 Hz",
        ),
    ],
)
def test_incomplete_or_unknown_statements_are_refused(write, tmp_path, columns, options, words):
    with pytest.raises(ImportRefused, match=words):
        import_recording(write(), tmp_path / "bag", columns, **options)


def test_missing_samples_are_reported_and_never_filled(write, tmp_path):
    truth = synthetic()
    truth["torque"][[100, 101, 5000]] = np.nan
    truth["position"][7000] = np.inf
    source = write(**truth)
    kept = import_recording(source, tmp_path / "kept", STATED, torque_sign="rig")
    assert any(
        "torque[N.m]: 3 samples are missing or not finite, from t = 0.100000 to 5.000000 s; kept"
        in w
        for w in kept.warnings
    )
    assert any("position[rad]: 1 samples" in w for w in kept.warnings)
    _, data = BagReader(tmp_path / "kept").signal("/ankle/samples")
    assert np.flatnonzero(np.isnan(data).any(axis=1)).tolist() == [100, 101, 5000, 7000]
    left = import_recording(source, tmp_path / "left", STATED, torque_sign="rig", missing="gap")
    assert left.samples == 20000 - 4
    _, data = BagReader(tmp_path / "left").signal("/ankle/samples")
    stream = Continuity()
    stream.check(data)
    assert stream.missing == 4
    assert np.isfinite(data).all()


def test_a_gap_in_time_stays_a_gap_and_is_reported(write, tmp_path):
    truth = {name: np.delete(values, slice(3000, 3250)) for name, values in synthetic().items()}
    report = import_recording(write(**truth), tmp_path / "bag", STATED, torque_sign="rig")
    assert any(
        "250 samples (0.250 s) missing before t = 3.25" in warning for warning in report.warnings
    )
    assert np.array_equal(
        BagReader(tmp_path / "bag").signal("/ankle/samples")[1][:, 0], truth["time"]
    )


def test_without_fast_movement_the_report_says_that_nothing_was_verified(write, tmp_path):
    source = write(position=np.full(20000, 0.1))
    report = import_recording(source, tmp_path / "bag", STATED, torque_sign="subject")
    assert report.intrinsic is None
    assert any("were not verified" in warning for warning in report.warnings)


def test_negative_times_are_shifted_and_reported(write, tmp_path):
    report = import_recording(
        write(time=synthetic()["time"] - 2.5), tmp_path / "bag", STATED, torque_sign="rig"
    )
    assert any("3 s are added" in warning for warning in report.warnings)
    assert BagReader(tmp_path / "bag").signal("/ankle/samples")[1][0, 0] == pytest.approx(0.5)


def test_existing_bag_is_not_overwritten(write, tmp_path):
    source = write()
    import_recording(source, tmp_path / "bag", STATED, torque_sign="rig")
    with pytest.raises(BagError, match="nothing is overwritten unasked"):
        import_recording(source, tmp_path / "bag", STATED, torque_sign="rig")
    import_recording(source, tmp_path / "bag", STATED, torque_sign="rig", overwrite=True)


@pytest.mark.parametrize("file_format", ["csv", "npz"])
def test_export_and_import_again_gives_the_same_numbers(write, tmp_path, file_format):
    import_recording(write(), tmp_path / "bag", STATED, torque_sign="rig")
    seen = []
    output = tmp_path / ("folder" if file_format == "csv" else "out.npz")
    (path,) = export_bag(tmp_path / "bag", output, file_format, progress=seen.append)
    assert seen[-1] == 1.0
    prefix = "" if file_format == "csv" else "ankle_samples."
    again = {name: prefix + name for name in STATED}
    import_recording(path, tmp_path / "again", again, torque_sign="rig")
    first, second = (
        BagReader(tmp_path / name).signal("/ankle/samples") for name in ("bag", "again")
    )
    assert first[0] == second[0]
    assert np.array_equal(first[1], second[1])
    with pytest.raises(BagError, match="--overwrite"):
        export_bag(tmp_path / "bag", output, file_format)


def test_a_saturated_channel_is_said_with_its_share(write, tmp_path):
    torque = synthetic()["torque"]
    source = write(torque=np.minimum(torque, np.quantile(torque, 0.95)))
    report = import_recording(source, tmp_path / "bag", STATED, torque_sign="rig")
    (said,) = report.warnings
    assert said.startswith("torque is saturated: 4.8 % of the samples stand at its upper end")
    assert said in BagReader(tmp_path / "bag").custom_data["warnings"]
