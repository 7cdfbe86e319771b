"""Thirty files as laboratories have them: each is imported by the proposed line, or refused with
the line that mends it.
"""

import sys
from itertools import pairwise

import numpy as np
import pytest
from laboratory_binaries import BINARIES, edf_mechanics
from laboratory_texts import TEXTS, csv_emg, csv_reference, csv_titles
from laboratory_trial import RATE, TRIAL, plain, trial
from program_files import (
    HAVE_A_COMMAND,
    HAVE_EMG,
    PROGRAMS,
    force_plate,
    left_leg_at_rest,
    means_below_the_numbers,
    nexus_devices_first,
    nexus_devices_last,
    plantarflexion,
    right_angle,
    rows_written_twice,
)
from refused_files import REFUSED, irregular, two_trials

from session_recorder.bag_reader import BagReader
from session_recorder.errors import ImportRefused
from session_recorder.importing import (
    import_recording,
    motion_capture_tables,
    propose,
    read_table,
)
from session_recorder.importing.laboratory_units import known_unit, split_header
from session_recorder.importing.sampling import judge_times, repeated_times, resample_columns

# What the proposed line or the import says of a file, and what it must not say.
SAID = {
    right_angle: {"--neutral 90": True, "--positive": False},
    plantarflexion: {"--positive plantarflexion": True, "--neutral": False},
    nexus_devices_first: {"--section Devices": True, "not 'Trajectories'": True},
    nexus_devices_last: {"--section Devices": True, "--rate 500": True},
    means_below_the_numbers: {"2 lines below the numbers are left out": True, "--section": False},
    force_plate: {"torque[N.mm]=My (Nmm)": True, "velocity[rad/s]=velocity_rad_s": True},
    left_leg_at_rest: {"torque[N.m]=Right torque (Nm)": True, "SOL[V]=RSOL (V)": True},
    rows_written_twice: {"16 of them hold the same numbers": True, "--resample": False},
}


@pytest.mark.parametrize("make", [*TEXTS, *BINARIES, *PROGRAMS], ids=lambda make: make.__name__)
def test_laboratory_files_are_imported_by_the_proposed_line(make, tmp_path):
    make(tmp_path / "file")
    (source,) = tmp_path.iterdir()
    table = read_table(source)
    proposal = propose(table)
    report = import_recording(
        table,
        tmp_path / "bag",
        proposal.columns,
        torque_sign=proposal.torque_sign,
        rate=proposal.rate,
        resample=proposal.resample,
        neutral=proposal.neutral,
        positive=proposal.positive,
    )
    made = trial(2048.0, 20_000) if "rounded" in make.__name__ else TRIAL
    assert report.rate == pytest.approx(2048.0 if "rounded" in make.__name__ else RATE)
    assert report.intrinsic.inertia == pytest.approx(0.0137, rel=0.05)
    columns, data = BagReader(tmp_path / "bag").signal("/ankle/samples")
    exact = 2e-3 if make in (edf_mechanics,) else 1e-6
    for name in columns[1:]:
        truth = made[name.split("[")[0]]
        np.testing.assert_allclose(data[:, columns.index(name)], truth, atol=exact * np.ptp(truth))
    assert {"position[rad]", "torque[N.m]"} < set(columns)
    line = proposal.command(source, tmp_path / "bag")
    assert line.startswith("ankle import")
    assert all(
        f"{name}={column}" in line.replace("'", "").replace('"', "")
        for name, column in proposal.columns.items()
    )
    said = f"{line} {' '.join(report.warnings)}"
    for option, expected in SAID.get(make, {}).items():
        assert (option in said) is expected, said
    if make in HAVE_EMG:
        names, emg = BagReader(tmp_path / "bag").signal("/emg/samples")
        np.testing.assert_allclose(emg[:, names.index("SOL[V]")], TRIAL["emg"], atol=1e-9)
    if make is csv_emg:
        names, emg = BagReader(tmp_path / "bag").signal("/emg/samples")
        assert names == ("t[s]", "SOL[V]", "TA[V]", "GL[V]", "GM[V]")
        np.testing.assert_allclose(emg[:, 1], TRIAL["emg"], atol=1e-12)
    if make in (csv_reference, *HAVE_A_COMMAND):
        assert (
            BagReader(tmp_path / "bag").signal("/perturbation/reference")[0][1] == "position[rad]"
        )


def test_a_table_of_several_is_chosen_by_title_number_or_stated_columns(tmp_path):
    two_trials(tmp_path / "file")
    source = tmp_path / "file.csv"
    half = len(TRIAL["t"]) // 2
    for asked in ("Trial 2", "trial 2", "2"):
        table = read_table(source, asked)
        np.testing.assert_allclose(table.columns["Torque (Nm)"], TRIAL["torque"][half:], rtol=1e-8)
    with pytest.raises(ImportRefused, match=r"no table 'Trial 3'; it holds 1 'Trial 1': 2500 rows"):
        read_table(source, "Trial 3")
    nexus_devices_first(tmp_path / "nexus")
    table = read_table(tmp_path / "nexus.csv", wanted=["S04:LANK X"])
    assert (table.section, table.rate) == ("Trajectories", 50.0)


def test_a_text_among_the_numbers_does_not_divide_a_table(tmp_path):
    csv_titles(tmp_path / "file")
    lines = (tmp_path / "file.csv").read_text().splitlines()
    lines.insert(2000, "trigger,pressed,0")
    (tmp_path / "file.csv").write_text("\n".join(lines))
    with pytest.raises(ImportRefused, match=r"line 2001: 'trigger' in column 'Time \(s\)'"):
        propose(read_table(tmp_path / "file.csv"))


@pytest.mark.parametrize(
    ("header", "doubt"),
    [
        (["Sampling rate: 1000 Hz", "Time (s),Angle (deg),Torque (Nm)"], "rate of 1000 Hz is stat"),
        (["Time (s),Angle (deg),Load cell (N)"], "a force has to be multiplied by its lever arm"),
    ],
)
def test_what_a_file_contradicts_or_lacks_is_a_doubt(header, doubt, tmp_path):
    (tmp_path / "file.csv").write_text(plain(*header))
    assert any(doubt in sentence for sentence in propose(read_table(tmp_path / "file.csv")).doubts)


def import_as_proposed(source, bag):
    table = read_table(source)
    import_recording(table, bag, propose(table).columns, torque_sign="rig")


@pytest.mark.parametrize("make", REFUSED, ids=lambda make: make.__name__)
def test_what_cannot_be_imported_is_refused_with_the_line_that_mends_it(make, tmp_path):
    make(tmp_path / "file")
    (source,) = tmp_path.iterdir()
    with pytest.raises(ImportRefused) as refusal:
        import_as_proposed(source, tmp_path / "bag")
    assert REFUSED[make] in str(refusal.value)
    assert not (tmp_path / "bag").exists()


def test_an_irregular_recording_is_resampled_when_asked_and_pauses_stay(tmp_path):
    irregular(tmp_path / "file")
    proposal = propose(read_table(tmp_path / "file.csv"))
    assert "--resample 499" in proposal.command("file.csv", "bag")
    report = import_recording(
        tmp_path / "file.csv",
        tmp_path / "bag",
        proposal.columns,
        torque_sign=proposal.torque_sign,
        resample=0.0,
    )
    assert any("steps of 0.6" in warning for warning in report.warnings)
    columns, data = BagReader(tmp_path / "bag").signal("/ankle/samples")
    truth = np.interp(data[:, 0], TRIAL["t"], TRIAL["position"])
    np.testing.assert_allclose(
        data[50:-50, columns.index("position[rad]")], truth[50:-50], atol=2e-3
    )
    t = np.concatenate([np.arange(100), np.arange(200, 300)]) / 100.0
    grid, made, left_out = resample_columns(t, {"x": t}, 200.0)
    assert left_out > 0
    assert not ((grid > 1.0) & (grid < 1.99)).any()
    np.testing.assert_allclose(made["x"], grid)


def test_times_are_judged_by_their_steps():
    even = np.arange(2000) / 1000.0
    assert judge_times(even).kind == "regular"
    assert judge_times(np.delete(even, slice(500, 700))).kind == "regular"
    assert judge_times(np.round(np.arange(4000) / 2048, 3)).kind == "rounded"
    assert judge_times(np.round(np.arange(4000) / 2048, 3)).rate == 2048.0
    assert (
        judge_times(np.cumsum(np.random.default_rng(1).uniform(0.5, 1.5, 2000)) / 500).kind
        == "irregular"
    )
    with pytest.raises(ValueError, match="does not increase"):
        judge_times(-even)


def test_times_that_were_cut_to_milliseconds_lose_no_sample():
    cut = (1000 * np.arange(12_000) / 1000 - 1e-9 * (np.arange(12_000) % 97 == 5)) // 1 / 1000
    assert (np.diff(cut) == 0).sum() == 124
    assert not repeated_times(cut).any()
    assert judge_times(cut).kind == "rounded"
    assert judge_times(cut).rate == 1000.0


@pytest.mark.parametrize(
    ("spelled", "unit"),
    [
        ("Nm", "N.m"),
        ("N*m", "N.m"),
        ("N·m", "N.m"),
        ("N m", "N.m"),
        ("nm", "N.m"),
        ("mNm", "mN.m"),
        ("°", "deg"),
        ("Degrees", "deg"),
        ("°/s", "deg/s"),
        ("deg/sec", "deg/s"),
        ("µV", "uV"),
        ("μV", "uV"),
        ("mV", "mV"),
        ("sec", "s"),
        ("rad s^-1", "rad/s"),
        ("Grad", "deg"),
        ("ft-lb", "lbf.ft"),
        ("deg_s", "deg/s"),
        ("furlong", None),
        ("", None),
    ],
)
def test_spellings_of_units(spelled, unit):
    assert known_unit(spelled) == unit


@pytest.mark.parametrize(
    ("header", "parts"),
    [
        ("Time (s)", ("Time", "s")),
        ("Torque_Nm", ("Torque", "N.m")),
        ("Angle, deg", ("Angle", "deg")),
        ("pos/rad", ("pos", "rad")),
        ("torque [mN.m]", ("torque", "mN.m")),
        ("EMG SOL", ("EMG SOL", None)),
        ("velocity (deg/s)", ("velocity", "deg/s")),
        ("Phase (hold)", ("Phase (hold)", None)),
        ("torque_min", ("torque_min", None)),
        ("Torque_N_m", ("Torque", "N.m")),
    ],
)
def test_units_in_headers(header, parts):
    assert split_header(header) == parts


@pytest.mark.parametrize(
    ("suffix", "module"),
    [(".xlsx", "openpyxl"), (".parquet", "pyarrow"), (".tdms", "npTDMS")],
)
def test_a_library_that_is_absent_is_named(suffix, module, tmp_path, monkeypatch):
    name = {"pyarrow": "pyarrow.parquet", "npTDMS": "nptdms"}.get(module, module)
    monkeypatch.setitem(sys.modules, name, None)
    (tmp_path / f"a{suffix}").write_bytes(b"\x02\x50 anything")
    with pytest.raises(ImportRefused, match=f"pip install {module}"):
        read_table(tmp_path / f"a{suffix}")


def test_the_absent_library_of_motion_capture_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ezc3d", None)
    with pytest.raises(ImportRefused, match="pip install ezc3d"):
        motion_capture_tables.read(tmp_path / "a.c3d")


def test_numbers_inside_matlab_objects_are_found():
    from session_recorder.importing.array_tables import _object_matrices

    def element(kind, payload):
        return (
            np.array([kind, len(payload)], "<u4").tobytes() + payload + b"\0" * (-len(payload) % 8)
        )

    def matrix(values):
        flags = element(6, np.array([6, 0], "<u4").tobytes())
        shape = element(5, np.array(values.shape, "<i4").tobytes())
        name = element(1, b"")
        return element(14, flags + shape + name + element(9, values.T.astype("<f8").tobytes()))

    first, second = np.random.default_rng(4).normal(size=(2, 500, 2))
    holder = element(
        14, element(6, np.array([1, 0], "<u4").tobytes()) + matrix(first) + matrix(np.eye(3))
    )
    stream = b"\0" * 8 + holder + matrix(second)
    found = list(_object_matrices(stream))
    assert [m.shape for m in found] == [(500, 2), (500, 2)]
    assert np.array_equal(found[0], first)
    assert np.array_equal(found[1], second)
    for cut, _ in pairwise(range(0, len(stream), 997)):
        assert all(m.shape == (500, 2) for m in _object_matrices(stream[:cut]))
