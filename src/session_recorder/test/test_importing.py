"""Import: values in SI and in this project's signs, and refusal of what the data contradict."""

import re
from pathlib import Path

import edfio
import numpy as np
import pytest
from scipy.io import savemat

from ankle_interfaces.continuity import Continuity
from session_recorder.bag_reader import BagReader
from session_recorder.errors import BagError, ImportRefused
from session_recorder.exporting import export_bag
from session_recorder.importing import import_recording

RECORDINGS = Path(__file__).resolve().parents[4] / "shared" / "recordings"
STATED = {"t[s]": "time", "position[rad]": "position", "torque[N.m]": "torque"}
I, B, K = 0.0137, 0.63, 100.0  # the paper's ankle


def synthetic(seconds=20.0, rate=1000.0, noise=0.02):
    """An ankle of known I, B and K under smooth random steps of 20 mrad, at 0.1 rad, with torque of
    the rig's sign.
    """
    n = int(seconds * rate)
    random = np.random.default_rng(5)
    t = np.arange(n) / rate
    level, position = 0.0, np.empty(n)
    for k in range(n):
        if k % 250 == 0:
            level = random.uniform(-0.02, 0.02)
        position[k] = level
    width = int(0.02 * rate)
    kernel = np.hanning(width) / np.hanning(width).sum()
    position = np.convolve(position, kernel, "same")
    velocity = np.gradient(position, 1 / rate)
    torque = I * np.gradient(velocity, 1 / rate) + B * velocity + K * position
    torque += noise * torque.std() * random.normal(size=n) - 3.0 + np.sin(2 * np.pi * 0.1 * t)
    return {"time": t, "position": position + 0.1, "velocity": velocity, "torque": torque}


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


@pytest.fixture
def edf(tmp_path):
    """Two seconds of EMG at 2048 Hz as an amplifier stores them, in microvolts; names and further
    signals as asked for.
    """

    def write(*labels, unit="uV", rate=2048.0, further=(), suffix=".edf"):
        emg = np.random.default_rng(3).uniform(-900.0, 900.0, (len(labels), round(2 * rate)))
        make, make_file = (
            (edfio.BdfSignal, edfio.Bdf) if suffix == ".bdf" else (edfio.EdfSignal, edfio.Edf)
        )
        signals = [
            make(row, rate, label=label, physical_dimension=unit)
            for row, label in zip(emg, labels, strict=True)
        ]
        make_file([*signals, *further]).write(tmp_path / f"emg{suffix}")
        return tmp_path / f"emg{suffix}", 1e-6 * emg

    return write


@pytest.mark.parametrize(
    ("suffix", "resolution"), [(".edf", 1800e-6 / 2**16), (".bdf", 1800e-6 / 2**24)]
)
def test_emg_of_an_amplifier_comes_in_volts_with_the_time_of_the_file(
    edf, tmp_path, suffix, resolution
):
    source, emg = edf("soleus", "TA", suffix=suffix)
    report = import_recording(source, tmp_path / "bag", {"t[s]": "t", "SOL[uV]": "soleus"})
    assert (report.samples, report.ignored, report.warnings) == (4096, ("TA",), ())
    assert report.rate == pytest.approx(2048.0)
    columns, data = BagReader(tmp_path / "bag").signal("/emg/samples")
    assert columns == ("t[s]", "SOL[V]")
    np.testing.assert_allclose(data[:, 0], np.arange(4096) / 2048.0, atol=1e-9)
    np.testing.assert_allclose(data[:, 1], emg[0], atol=1.01 * resolution)


def test_what_an_edf_file_contradicts_is_refused(edf, tmp_path):
    source, _ = edf(
        "SOL",
        "TA",
        "TA",
        further=[edfio.EdfSignal(np.arange(200.0), 100.0, label="GL", physical_dimension="uV")],
    )
    for columns, words in (
        ({"SOL[mV]": "SOL"}, "'SOL[mV]' is stated in mV, the file declares 'SOL' in uV"),
        ({"SOL[uV]": "soleus"}, "has no column 'soleus'; it holds t, SOL, TA:1, TA:2, GL"),
        ({"TA[uV]": "TA"}, "has more than one column 'TA'"),
        ({"SOL[uV]": "SOL", "GL[uV]": "GL"}, "different sampling rates: SOL 2048 Hz, GL 100 Hz"),
    ):
        with pytest.raises(ImportRefused, match=re.escape(words)):
            import_recording(source, tmp_path / "bag", {"t[s]": "t", **columns})
    with pytest.raises(
        ImportRefused, match="stated sampling rate is 1000 Hz, the time column steps at 2048 Hz"
    ):
        import_recording(source, tmp_path / "bag", {"t[s]": "t", "SOL[uV]": "SOL"}, rate=1000.0)


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_csv_with_and_without_header(tmp_path, delimiter):
    truth = synthetic(seconds=5)
    table = np.column_stack([truth["time"], truth["position"], truth["torque"]])
    rows = [delimiter.join(repr(float(value)) for value in row) for row in table]
    (tmp_path / "a.csv").write_text(
        "\n".join([delimiter.join(["time", "position", "torque"]), *rows])
    )
    (tmp_path / "b.csv").write_text("\n".join(rows))
    import_recording(tmp_path / "a.csv", tmp_path / "a", STATED, torque_sign="rig")
    import_recording(
        tmp_path / "b.csv",
        tmp_path / "b",
        {"t[s]": "1", "position[rad]": "2", "torque[N.m]": "3"},
        torque_sign="rig",
    )
    for name in ("a", "b"):
        assert np.array_equal(BagReader(tmp_path / name).signal("/ankle/samples")[1], table)


def test_csv_cells_that_are_empty_or_wrong(tmp_path):
    rows = [f"{k / 1000},{0.1 + 0.01 * np.sin(k / 10)},x" for k in range(3000)]
    rows[4] = "0.004,,x"
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["time,position,comment", *rows]))
    report = import_recording(path, tmp_path / "bag", {"t[s]": "time", "position[rad]": "position"})
    assert any("1 samples are missing" in warning for warning in report.warnings)
    assert report.ignored == ("comment",)
    rows[7] = "0.007,abc,x"
    path.write_text("\n".join(["time,position,comment", *rows]))
    with pytest.raises(ImportRefused, match="line 9: 'abc' in column 'position' is not a number"):
        import_recording(path, tmp_path / "other", {"t[s]": "time", "position[rad]": "position"})


def test_mat_with_structures_and_matrices(tmp_path):
    truth = synthetic(seconds=5)
    matrix = np.column_stack([truth["position"], truth["torque"]])
    savemat(
        tmp_path / "a.mat", {"trial": {"time": truth["time"], "signals": matrix}, "subject": "3"}
    )
    stated = {
        "t[s]": "trial.time",
        "position[rad]": "trial.signals:1",
        "torque[N.m]": "trial.signals:2",
    }
    import_recording(tmp_path / "a.mat", tmp_path / "bag", stated, torque_sign="rig")
    assert np.array_equal(
        BagReader(tmp_path / "bag").signal("/ankle/samples")[1],
        np.column_stack([truth["time"], matrix]),
    )


@pytest.mark.parametrize("name", ["a.csv", "a.npz", "a.mat", "a.edf", "a.bdf", "a.xlsx"])
def test_files_that_are_missing_or_something_else(tmp_path, name):
    with pytest.raises(ImportRefused, match=name):
        import_recording(tmp_path / name, tmp_path / "bag", STATED, torque_sign="rig")
    (tmp_path / name).write_bytes(b"\x00\xff\x80 no such file format \n\n")
    with pytest.raises(ImportRefused, match=name):
        import_recording(tmp_path / name, tmp_path / "bag", STATED, torque_sign="rig")


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
    with pytest.raises(BagError, match="nothing is overwritten unasked"):
        export_bag(tmp_path / "bag", output, file_format)
