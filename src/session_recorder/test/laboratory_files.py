"""Writes files as laboratories have them: those that are imported, and those that are refused."""

import datetime

import edfio
import h5py
import nptdms
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet
import pytest
from scipy.io import savemat

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


def clock_times(path, begin, title="Timestamp"):
    """A CSV file whose times are times of day, from a moment on."""
    lines = [
        f"{(begin + datetime.timedelta(seconds=float(t))).strftime('%H:%M:%S.%f')},{a:.9g},{m:.9g}"
        for t, a, m in zip(TRIAL["t"], DEG, TRIAL["torque"], strict=True)
    ]
    path.with_suffix(".csv").write_text("\n".join([f"{title},Angle (deg),Torque (Nm)", *lines]))


def csv_clock_times(path):
    clock_times(path, datetime.datetime(2024, 3, 2, 10, 59, 55))


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


def two_trials(path):
    half = len(DEG) // 2
    blocks = [
        text(
            [TRIAL["t"][:half], DEG[part], TRIAL["torque"][part]],
            header=[f"Trial {number}", "Time (s),Angle (deg),Torque (Nm)"],
        )
        for number, part in ((1, slice(half)), (2, slice(half, None)))
    ]
    path.with_suffix(".csv").write_text("\n".join(blocks))


def torque_by_body_mass(path):
    path.with_suffix(".csv").write_text(
        text(
            [TRIAL["t"], DEG, TRIAL["torque"] / 70],
            header=["Time (s),Angle (deg),Ankle moment (Nm/kg)"],
        )
    )


def angle_in_volts(path):
    path.with_suffix(".csv").write_text(
        text([TRIAL["t"], DEG / 5, TRIAL["torque"]], header=["Time (s),Angle (V),Torque (Nm)"])
    )


def unknown_unit_of_torque(path):
    path.with_suffix(".csv").write_text(
        text([TRIAL["t"], DEG, TRIAL["torque"]], header=["Time (s),Angle (deg),Torque (ozf.in)"])
    )


def number_for_a_missing_value(path):
    torque = np.where(np.arange(N) == 700, 9999.0, TRIAL["torque"])
    path.with_suffix(".csv").write_text(
        text([TRIAL["t"], DEG, torque], header=["Time (s),Angle (deg),Torque (Nm)"])
    )


def one_group_of_thousands(path):
    """``1,000`` may be a thousand or one: nothing is guessed."""
    rows = [
        f'"{k:,}";{a:.9g};{m:.9g}' for k, a, m in zip(range(N), DEG, TRIAL["torque"], strict=True)
    ]
    path.with_suffix(".csv").write_text("\n".join(["Time (ms);Angle (deg);Torque (Nm)", *rows]))


REFUSED = {
    irregular: "--resample 499",
    no_rate: "--rate 2048",
    decimal_commas_between_commas: "save it with ';' or tabs",
    nothing_known: "--column 'position[deg]=NAME'",
    only_text: "holds no rows of numbers",
    two_trials: "--section 'Trial 1'",
    torque_by_body_mass: "multiply it by the subject's body mass",
    angle_in_volts: "multiply it by the factor of its sensor",
    unknown_unit_of_torque: "is in ozf.in, which is no unit that is known: convert it",
    number_for_a_missing_value: "is 9999 written where a value is missing",
    one_group_of_thousands: "line 1002: '1,000' in column 'Time (ms)', a group of thousands or",
}
