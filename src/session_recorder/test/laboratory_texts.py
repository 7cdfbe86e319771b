"""Writes files of text as laboratories have them, each of which is imported."""

import datetime

import numpy as np
from laboratory_trial import DEG, TRIAL, plain, text, trial


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


TEXTS = [
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
]
