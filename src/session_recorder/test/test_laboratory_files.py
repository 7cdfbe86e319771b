"""Thirty files as laboratories have them: each is imported by the proposed line, or refused with
the line that mends it.
"""

import datetime
import sys
from itertools import pairwise

import edfio
import h5py
import nptdms
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet
import pytest
from scipy.io import savemat

from session_recorder.bag_reader import BagReader
from session_recorder.errors import ImportRefused
from session_recorder.importing import import_recording, propose, read_table
from session_recorder.importing.laboratory_units import known_unit, split_header
from session_recorder.importing.sampling import judge_times, resample_columns

RATE = 500.0
N = 5_000


def trial(rate=RATE, n=N):
    """An ankle of 0.0137 kg.m^2 under random steps: t, position, velocity, torque, EMG."""
    random = np.random.default_rng(8)
    t = np.arange(n) / rate
    steps = np.repeat(random.uniform(-0.02, 0.02, n // 100 + 1), 100)[:n]
    kernel = np.hanning(int(0.02 * rate))
    position = np.convolve(steps, kernel / kernel.sum(), "same") + 0.1
    velocity = np.gradient(position, 1 / rate)
    torque = 0.0137 * np.gradient(velocity, 1 / rate) + 0.6 * velocity + 90 * (position - 0.1) - 3
    emg = 2e-5 * random.standard_normal(n)
    return {"t": t, "position": position, "velocity": velocity, "torque": torque, "emg": emg}


TRIAL = trial()
DEG = np.degrees(TRIAL["position"])


def text(columns, delimiter=",", decimal=".", header=(), end=""):
    rows = np.column_stack(columns)
    lines = [delimiter.join(f"{v:.9g}" for v in row) + end for row in rows]
    if decimal == ",":
        lines = [line.replace(".", ",") for line in lines]
    return "\n".join([*header, *lines]) + "\n"


def plain(*names, **options):
    """A text of time, angle in degrees and torque."""
    return text([TRIAL["t"], DEG, TRIAL["torque"]], header=names, **options)


def csv_titles(path):
    path.with_suffix(".csv").write_text(plain("Time (s),Ankle Angle (deg),Torque (Nm)"))


def csv_semicolon_decimal_comma(path):
    header = "Zeit [s];Winkel [°];Drehmoment [Nm]"
    content = plain(header, delimiter=";", decimal=",")
    path.with_suffix(".csv").write_text(content, encoding="latin-1")


def tsv_decimal_comma(path):
    path.with_suffix(".tsv").write_text(
        plain("tijd (s)\thoek (graden)\tkoppel (N·m)", delimiter="\t", decimal=",")
    )


def csv_row_of_units(path):
    path.with_suffix(".csv").write_text(plain("Time,Angle,Torque", "s,deg,Nm"))


def csv_preamble(path):
    header = [
        "Subject: 12",
        "Date: 2024-03-02",
        "",
        "Sampling rate (Hz): 500",
        "",
        "Angle (deg),Torque (Nm)",
    ]
    path.with_suffix(".csv").write_text(text([DEG, TRIAL["torque"]], header=header))


def csv_comments(path):
    path.with_suffix(".csv").write_text(
        plain("# exported by the rig's software", "# v2.1, ok", "time_s,angle_deg,torque_Nm")
    )


def txt_comment_is_header(path):
    path.with_suffix(".txt").write_text(plain("# time[s] angle[deg] torque[Nm]", delimiter=" "))


def txt_matlab_export(path):
    path.with_suffix(".txt").write_text(
        text([TRIAL["t"], TRIAL["position"], TRIAL["torque"]], delimiter="   ")
    )


def csv_quoted_decimal_commas(path):
    rows = np.column_stack([TRIAL["t"], DEG, TRIAL["torque"]])
    lines = [",".join(f'"{v:.9g}"'.replace(".", ",") for v in row) for row in rows]
    path.with_suffix(".csv").write_text(
        "\n".join(['"Time (s)","Angle (deg)","Torque (Nm)"', *lines])
    )


def csv_trailing_delimiter(path):
    path.with_suffix(".csv").write_text(plain("Time (s),Angle (deg),Torque (Nm),", end=","))


def csv_windows_bom_crlf(path):
    content = plain("Time (s),Angle (deg),Torque (Nm)").replace("\n", "\r\n")
    path.with_suffix(".csv").write_bytes(b"\xef\xbb\xbf" + content.encode())


def txt_utf16(path):
    content = plain("Time (s)\tAngle (°)\tTorque (N·m)", delimiter="\t")
    path.with_suffix(".txt").write_bytes(content.encode("utf-16"))


def csv_milliseconds(path):
    path.with_suffix(".csv").write_text(
        text([1000 * TRIAL["t"], DEG, TRIAL["torque"]], header=["Time (ms),Angle (°),Moment (N*m)"])
    )


def csv_milli_newton_metres(path):
    path.with_suffix(".csv").write_text(
        text(
            [TRIAL["t"], TRIAL["position"], 1000 * TRIAL["torque"]],
            header=["time,angle_rad,torque_mNm"],
        )
    )


def csv_no_units(path):
    path.with_suffix(".csv").write_text(
        text(
            [TRIAL["t"], DEG, np.degrees(TRIAL["velocity"]), -TRIAL["torque"]],
            header=["time,angle,velocity,torque"],
        )
    )


def csv_no_header(path):
    path.with_suffix(".csv").write_text(plain())


def csv_text_column(path):
    rows = plain("Time (s),Angle (deg),Torque (Nm),Phase").splitlines()
    path.with_suffix(".csv").write_text("\n".join([rows[0], *(f"{r},hold" for r in rows[1:])]))


def csv_clock_times(path):
    begin = datetime.datetime(2024, 3, 2, 10, 59, 55)
    lines = [
        f"{(begin + datetime.timedelta(seconds=float(t))).strftime('%H:%M:%S.%f')},{a:.9g},{m:.9g}"
        for t, a, m in zip(TRIAL["t"], DEG, TRIAL["torque"], strict=True)
    ]
    path.with_suffix(".csv").write_text("\n".join(["Timestamp,Angle (deg),Torque (Nm)", *lines]))


def csv_rounded_times(path):
    rate = 2048.0
    made = trial(rate, 20_000)
    path.with_suffix(".csv").write_text(
        text(
            [np.round(made["t"], 3), np.degrees(made["position"]), made["torque"]],
            header=["Time (s),Angle (deg),Torque (Nm)"],
        )
    )


def csv_index_column(path):
    rows = plain(",Time (s),Angle (deg),Torque (Nm)").splitlines()
    path.with_suffix(".csv").write_text(
        "\n".join([rows[0], *(f"{k},{row}" for k, row in enumerate(rows[1:]))])
    )


def lvm_labview(path):
    header = [
        "LabVIEW Measurement",
        "Writer_Version\t2",
        "***End_of_Header***",
        "",
        "X_Value\tAngle (deg)\tTorque (Nm)\tComment",
    ]
    path.with_suffix(".lvm").write_text(plain(*header, delimiter="\t"))


def csv_emg(path):
    header = [
        "Time (s),Ankle Angle (deg),Torque (Nm),Soleus (µV),Tib Ant (µV),Gas Lat (µV),Gas Med (µV)"
    ]
    emg = [1e6 * np.roll(TRIAL["emg"], k) for k in range(4)]
    path.with_suffix(".csv").write_text(
        text([TRIAL["t"], DEG, TRIAL["torque"], *emg], header=header), encoding="latin-1"
    )


def csv_reference(path):
    path.with_suffix(".csv").write_text(
        text(
            [TRIAL["t"], DEG, DEG, TRIAL["torque"]],
            header=["Time (s),Commanded Angle (deg),Ankle Angle (deg),Torque (Nm)"],
        )
    )


def xlsx(path):
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.append(["Export of session 4"])
    sheet.append([])
    sheet.append(["Time (s)", "Ankle Angle (deg)", "Torque (Nm)"])
    for row in zip(TRIAL["t"], DEG, TRIAL["torque"], strict=True):
        sheet.append([float(v) for v in row])
    book.create_sheet("Notes").append(["quiet subject"])
    book.save(path.with_suffix(".xlsx"))


def parquet(path):
    fields = [
        pa.field("t", pa.float64(), metadata={"unit": "s"}),
        pa.field("ankle", pa.float64(), metadata={"unit": "deg"}),
        pa.field("moment", pa.float64(), metadata={"unit": "N m"}),
    ]
    arrays = [pa.array(v) for v in (TRIAL["t"], DEG, TRIAL["torque"])]
    pyarrow.parquet.write_table(
        pa.Table.from_arrays(arrays, schema=pa.schema(fields)), path.with_suffix(".parquet")
    )


def mat_struct(path):
    savemat(
        path.with_suffix(".mat"),
        {"trial": {"time": TRIAL["t"], "angle_deg": DEG, "torque_Nm": TRIAL["torque"]}},
    )


def mat_with_rate(path):
    savemat(
        path.with_suffix(".mat"),
        {"data": {"position_rad": TRIAL["position"], "torque_Nm": TRIAL["torque"], "fs": RATE}},
    )


def mat_73(path):
    with h5py.File(path.with_suffix(".mat"), "w", userblock_size=512) as file:
        group = file.create_group("trial")
        for name, values in (
            ("time", TRIAL["t"]),
            ("angle_deg", DEG),
            ("torque_Nm", TRIAL["torque"]),
        ):
            data = group.create_dataset(name, data=values[None, :])
            data.attrs["MATLAB_class"] = np.bytes_("double")


def tdms(path):
    with nptdms.TdmsWriter(path.with_suffix(".tdms")) as writer:
        writer.write_segment(
            [
                nptdms.ChannelObject(
                    "rig", name, data, {"wf_increment": 1 / RATE, "unit_string": unit}
                )
                for name, data, unit in (("Angle", DEG, "deg"), ("Torque", TRIAL["torque"], "Nm"))
            ]
        )


def c3d(path):
    ezc3d = pytest.importorskip("ezc3d")
    file = ezc3d.c3d()
    file["header"]["points"]["frame_rate"] = 100.0
    file["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    file["parameters"]["ANALOG"]["RATE"]["value"] = [RATE]
    file["parameters"]["ANALOG"]["LABELS"]["value"] = ["Ankle Angle", "Ankle Torque"]
    file["parameters"]["ANALOG"]["UNITS"]["value"] = ["deg", "Nm"]
    file["data"]["points"] = np.zeros((4, 0, N // 5))
    file["data"]["analogs"] = np.array([[DEG, TRIAL["torque"]]])
    file.write(str(path.with_suffix(".c3d")))


def edf_mechanics(path):
    signals = [
        edfio.EdfSignal(DEG, RATE, label="Angle", physical_dimension="deg"),
        edfio.EdfSignal(TRIAL["torque"], RATE, label="Torque", physical_dimension="Nm"),
    ]
    edfio.Edf(signals).write(path.with_suffix(".edf"))


IMPORTED = [
    csv_titles,
    csv_semicolon_decimal_comma,
    tsv_decimal_comma,
    csv_row_of_units,
    csv_preamble,
    csv_comments,
    txt_comment_is_header,
    txt_matlab_export,
    csv_quoted_decimal_commas,
    csv_trailing_delimiter,
    csv_windows_bom_crlf,
    txt_utf16,
    csv_milliseconds,
    csv_milli_newton_metres,
    csv_no_units,
    csv_no_header,
    csv_text_column,
    csv_clock_times,
    csv_rounded_times,
    csv_index_column,
    lvm_labview,
    csv_emg,
    csv_reference,
    xlsx,
    parquet,
    mat_struct,
    mat_with_rate,
    mat_73,
    tdms,
    c3d,
    edf_mechanics,
]


@pytest.mark.parametrize("make", IMPORTED, ids=lambda make: make.__name__)
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
    if make is csv_emg:
        names, emg = BagReader(tmp_path / "bag").signal("/emg/samples")
        assert names == ("t[s]", "SOL[V]", "TA[V]", "GL[V]", "GM[V]")
        np.testing.assert_allclose(emg[:, 1], TRIAL["emg"], atol=1e-12)
    if make is csv_reference:
        assert (
            BagReader(tmp_path / "bag").signal("/perturbation/reference")[0][1] == "position[rad]"
        )


def irregular(path):
    random = np.random.default_rng(2)
    t = np.cumsum(random.uniform(0.0006, 0.0034, N))
    values = np.interp(t, TRIAL["t"], DEG)
    path.with_suffix(".csv").write_text(
        text(
            [t, values, np.interp(t, TRIAL["t"], TRIAL["torque"])],
            header=["Time (s),Angle (deg),Torque (Nm)"],
        )
    )


def no_rate(path):
    path.with_suffix(".csv").write_text(
        text([DEG, TRIAL["torque"]], header=["Angle (deg),Torque (Nm)"])
    )


def decimal_commas_between_commas(path):
    rows = [
        ",".join(f"{v:.3f}".replace(".", ",") for v in row)
        for row in zip(TRIAL["t"], DEG, TRIAL["torque"], strict=True)
    ]
    path.with_suffix(".csv").write_text("\n".join(["Time,Angle,Torque", *rows]))


def nothing_known(path):
    random = np.random.default_rng(1)
    path.with_suffix(".csv").write_text(
        text([TRIAL["t"], *random.standard_normal((2, N))], header=["Time (s),Alpha,Beta"])
    )


def only_text(path):
    path.with_suffix(".csv").write_text("subject,answer\nA,yes\nB,no\n")


def import_as_proposed(source, bag):
    table = read_table(source)
    import_recording(table, bag, propose(table).columns, torque_sign="rig")


REFUSED = {
    irregular: "--resample 499",
    no_rate: "--rate 2048",
    decimal_commas_between_commas: "save it with ';' or tabs",
    nothing_known: "--column 'position[deg]=NAME'",
    only_text: "holds no rows of numbers",
}


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
    ],
)
def test_units_in_headers(header, parts):
    assert split_header(header) == parts


@pytest.mark.parametrize(
    ("suffix", "module"),
    [(".xlsx", "openpyxl"), (".parquet", "pyarrow"), (".c3d", "ezc3d"), (".tdms", "npTDMS")],
)
def test_a_library_that_is_absent_is_named(suffix, module, tmp_path, monkeypatch):
    name = {"pyarrow": "pyarrow.parquet", "npTDMS": "nptdms"}.get(module, module)
    monkeypatch.setitem(sys.modules, name, None)
    (tmp_path / f"a{suffix}").write_bytes(b"\x02\x50 anything")
    with pytest.raises(ImportRefused, match=f"pip install {module}"):
        read_table(tmp_path / f"a{suffix}")


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
