"""Formats that are imported, EDF, CSV and MAT, and files that are missing or something else."""

import re

import edfio
import numpy as np
import pytest
from scipy.io import savemat
from synthetic_ankle import STATED, synthetic

from session_recorder.bag_reader import BagReader
from session_recorder.errors import ImportRefused
from session_recorder.importing import import_recording


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
