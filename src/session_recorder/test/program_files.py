"""Writes files as programs of laboratories export them, and recordings with other conventions."""

import datetime

import h5py
import numpy as np
import openpyxl
from laboratory_texts import clock_times
from laboratory_trial import DEG, RATE, TRIAL, text
from scipy.io import savemat

BEFORE_MIDNIGHT = datetime.datetime(2024, 3, 2, 23, 59, 55)
COLUMNS = [DEG, TRIAL["torque"], 1e3 * TRIAL["emg"]]


def nexus(path):
    """Vicon Nexus: the rate alone in the second line, groups, names, units; frames, no time."""
    header = [
        "Devices",
        f"{RATE:.0f}",
        ",,Rig,,EMG,",
        "Frame,Sub Frame,Angle,Torque,RSOL,Sync",
        ",,deg,N.mm,V,V",
    ]
    k = np.arange(len(DEG))
    columns = [k // 10 + 1, k % 10, DEG, 1e3 * TRIAL["torque"], TRIAL["emg"], 0 * k]
    path.with_suffix(".csv").write_text(text(columns, header=header))


def labchart(path):
    header = [
        f"Interval=\t{1 / RATE:g} s",
        "ExcelDateTime=\t4.5e+04\t3/2/2024 10:59:55",
        "ChannelTitle=\tAnkle angle\tTorque\tSoleus",
        "Range=\t10.0 V\t10.0 V\t1.000 mV",
        "UnitName=\tdeg\tNm\tmV",
    ]
    path.with_suffix(".txt").write_text(text([TRIAL["t"], *COLUMNS], delimiter="\t", header=header))


def acqknowledge(path):
    header = [
        "ankle_01.acq",
        f"{1e3 / RATE:g} msec/sample",
        "3 channels",
        "Footplate angle",
        "Deg",
        "Torque transducer",
        "N-m",
        "EMG - Soleus",
        "mV",
        "\tCH1\tCH2\tCH3",
        f"\t{len(DEG)}\t{len(DEG)}\t{len(DEG)}",
    ]
    path.with_suffix(".txt").write_text(text(COLUMNS, delimiter="\t", header=header, end="\t"))


def a_time_for_each_channel(path):
    header = "X [s],Goniometer: Angle [deg],X [s],Load cell: Torque [Nm],X [s],L SOLEUS: EMG 1 [mV]"
    columns = [each for column in COLUMNS for each in (TRIAL["t"], column)]
    path.with_suffix(".csv").write_text(text(columns, header=[header]))


def opensim(path):
    header = [
        "Coordinates",
        "version=1",
        f"nRows={len(DEG)}",
        "inDegrees=yes",
        "endheader",
        "time\tankle_angle_r\tankle_angle_r_moment",
    ]
    path.with_suffix(".mot").write_text(
        text([TRIAL["t"], DEG, TRIAL["torque"]], delimiter="\t", header=header)
    )


def matrix_with_labels(path):
    """The command moves as the measured angle does, and must not be taken for the torque."""
    command = TRIAL["position"] + 1e-4
    savemat(
        path.with_suffix(".mat"),
        {
            "data": np.column_stack([TRIAL["position"], TRIAL["torque"], TRIAL["emg"], command]),
            "labels": np.array(["pos", "tq", "SOL", "cmd"], dtype=object),
            "units": np.array(["rad", "Nm", "V", "rad"], dtype=object),
            "Fs": RATE,
        },
    )


def matrix_73_with_labels(path):
    with h5py.File(path.with_suffix(".mat"), "w", userblock_size=512) as file:
        data = file.create_dataset("data", data=np.stack([TRIAL["position"], TRIAL["torque"]]))
        data.attrs["MATLAB_class"] = np.bytes_("double")
        rate = file.create_dataset("fs", data=np.array([[RATE]]))
        rate.attrs["MATLAB_class"] = np.bytes_("double")
        references = []
        for k, label in enumerate(("Position_rad", "Torque_Nm")):
            cell = file.create_dataset(
                f"#refs#/{k}", data=np.array([[ord(c)] for c in label], np.uint16)
            )
            cell.attrs["MATLAB_class"] = np.bytes_("char")
            references.append([cell.ref])
        labels = file.create_dataset("labels", data=np.array(references, dtype=h5py.ref_dtype))
        labels.attrs["MATLAB_class"] = np.bytes_("cell")


def dates_across_midnight(path):
    lines = [
        f"{(BEFORE_MIDNIGHT + datetime.timedelta(seconds=float(t))).isoformat(' ', 'milliseconds')}"
        f";{angle:.9g};{torque:.9g}"
        for t, angle, torque in zip(TRIAL["t"], DEG, TRIAL["torque"], strict=True)
    ]
    path.with_suffix(".csv").write_text(
        "\n".join(["timestamp;hoek enkel [graden];koppel [Nm]", *lines])
    )


def clock_across_midnight(path):
    clock_times(path, BEFORE_MIDNIGHT, "Clock time")


def unit_behind_two_words(path):
    header = "TimeStamp[us],AnkPos_deg,AnkTrq_mNm,SOL_EMG_uV,TTL"
    columns = [1e6 * TRIAL["t"], DEG, 1e3 * TRIAL["torque"], 1e6 * TRIAL["emg"], 0 * DEG]
    path.with_suffix(".csv").write_text(text(columns, header=[header]))


def rows_written_twice(path):
    rows = text([TRIAL["t"], DEG, -TRIAL["torque"]]).splitlines()
    for k in range(4000, 0, -250):
        rows.insert(k, rows[k])
    path.with_suffix(".csv").write_text(
        "\n".join(["Subject;S11;;", "Time (s),Angle (deg),Torque (Nm)", *rows])
    )


def two_legs_below_groups(path):
    """Two rows of names: merged cells of a sheet above names that repeat."""
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.append([None, "Knee", None, "Ankle", None])
    sheet.append(["Time (s)", "Angle (deg)", "Torque (Nm)", "Angle (deg)", "Torque (Nm)"])
    knee = np.random.default_rng(5).standard_normal((2, len(DEG)))
    for row in zip(TRIAL["t"], *knee, DEG, TRIAL["torque"], strict=True):
        sheet.append([float(value) for value in row])
    book.save(path.with_suffix(".xlsx"))


def right_angle(path):
    """German: the angle between shank and foot, units in a row, milliseconds, mNm, a trigger."""
    header = ["Zeit;Fußwinkel;Fußmoment;EMG M. soleus;Trigger", "ms;°;mNm;µV;V"]
    columns = [1e3 * TRIAL["t"], DEG + 90, 1e3 * TRIAL["torque"], 1e6 * TRIAL["emg"], 0 * DEG]
    path.with_suffix(".csv").write_text(
        text(columns, delimiter=";", decimal=",", header=header), encoding="cp1252"
    )


def plantarflexion(path):
    header = "Time (s),Plantarflexion angle (deg),Torque (Nm)"
    path.with_suffix(".csv").write_text(text([TRIAL["t"], -DEG, -TRIAL["torque"]], header=[header]))


def nexus_sections(path, order):
    """Vicon Nexus with several tables below one another: 500 Hz, markers at 50 Hz."""
    k = np.arange(len(DEG))
    sections = {
        "Devices": (
            ["Devices", f"{RATE:.0f}", ",,Rig #1,,EMG #2", "Frame,Sub Frame,Angle,Torque,SOL"],
            ",,deg,N.mm,V",
            [k // 10 + 1, k % 10, DEG, 1e3 * TRIAL["torque"], TRIAL["emg"]],
        ),
        "Trajectories": (
            ["Trajectories", "50", ",,S04:LANK,,,S04:LTOE,,", "Frame,Sub Frame,X,Y,Z,X,Y,Z"],
            ",,mm,mm,mm,mm,mm,mm",
            [k[::10], 0 * k[::10], *np.random.default_rng(2).normal(100, 1, (6, len(k[::10])))],
        ),
    }
    parts = [text(sections[t][2], header=[*sections[t][0], sections[t][1]]) for t in order]
    path.with_suffix(".csv").write_text("\r\n".join(parts).replace("\n", "\r\n"))


def nexus_devices_first(path):
    nexus_sections(path, ["Devices", "Trajectories"])


def nexus_devices_last(path):
    nexus_sections(path, ["Trajectories", "Devices"])


def log_sheet_with_more_rows(path):
    book = openpyxl.Workbook()
    book.active.append(["Participant", "P04"])
    sheet = book.create_sheet("Trial")
    sheet.append(["Dynamometer export", None, None])
    sheet.append([])
    sheet.append(["Time", "Position", "Torque"])
    sheet.append(["sec", "deg", "N-m"])
    for row in zip(TRIAL["t"], DEG, TRIAL["torque"], strict=True):
        sheet.append([float(value) for value in row])
    log = book.create_sheet("Log")
    for k in range(len(DEG) + 10):
        log.append([k, "ok"])
    book.save(path.with_suffix(".xlsx"))


def texts_with_decimal_commas_in_a_sheet(path):
    book = openpyxl.Workbook()
    book.active.append(["Zeit [s]", "Winkel [°]", "Drehmoment [Nm]"])
    for row in zip(TRIAL["t"], DEG, TRIAL["torque"], strict=True):
        book.active.append([f"{value:.9g}".replace(".", ",") for value in row])
    book.save(path.with_suffix(".xlsx"))


def means_below_the_numbers(path):
    rows = text([TRIAL["t"], DEG, TRIAL["torque"]], header=["Time (s),Angle (deg),Torque (Nm)"])
    path.with_suffix(".csv").write_text(f"{rows}\nMean,2.87,-5.98\nMaximum,4.5,3.1\n")


def groups_of_thousands(path):
    rows = zip(1e3 * TRIAL["t"], DEG, 1e3 * TRIAL["torque"], strict=True)
    lines = [f'"{t:,.1f}",{angle:.9g},"{torque:,.7f}"' for t, angle, torque in rows]
    path.with_suffix(".csv").write_text("\n".join(["Time (ms),Angle (deg),Torque (Nmm)", *lines]))


def groups_of_thousands_german(path):
    rows = zip(1e3 * TRIAL["t"], DEG, 1e3 * TRIAL["torque"], strict=True)
    lines = [f"{t:,.1f};{angle:.9g};{torque:,.7f}" for t, angle, torque in rows]
    swapped = [line.translate(str.maketrans(",.", ".,")) for line in lines]
    path.with_suffix(".csv").write_text("\n".join(["Zeit (ms);Winkel (°);Moment (Nmm)", *swapped]))


def force_plate(path):
    """Three axes in N.mm, of which the second is the ankle's; the others are noise."""
    noise = np.random.default_rng(6).normal(0, 10, (2, len(DEG)))
    header = "Time (s),Fz (N),Mx (Nmm),My (Nmm),Mz (Nmm),Ankle angle (deg),velocity_rad_s"
    torque = 1e3 * TRIAL["torque"]
    columns = [TRIAL["t"], 0 * DEG + 700, noise[0], torque, noise[1], DEG, TRIAL["velocity"]]
    path.with_suffix(".csv").write_text(text(columns, header=[header]))


def left_leg_at_rest(path):
    rest = np.random.default_rng(7).normal(0, 0.01, (3, len(DEG)))
    header = "Time (s),Left angle (deg),Right angle (deg),Left torque (Nm),Right torque (Nm)"
    columns = [TRIAL["t"], rest[0], DEG, rest[1], TRIAL["torque"], 1e-3 * rest[2], TRIAL["emg"]]
    path.with_suffix(".csv").write_text(text(columns, header=[f"{header},LSOL (V),RSOL (V)"]))


def foot_pounds_and_minutes(path):
    header = "Time (min),Angle (deg),Torque (ft-lb)"
    columns = [TRIAL["t"] / 60, DEG, TRIAL["torque"] / 1.3558179483314]
    path.with_suffix(".csv").write_text(text(columns, header=[header]))


PROGRAMS = [
    nexus,
    labchart,
    acqknowledge,
    a_time_for_each_channel,
    opensim,
    matrix_with_labels,
    matrix_73_with_labels,
    dates_across_midnight,
    clock_across_midnight,
    unit_behind_two_words,
    rows_written_twice,
    two_legs_below_groups,
    right_angle,
    plantarflexion,
    nexus_devices_first,
    nexus_devices_last,
    log_sheet_with_more_rows,
    texts_with_decimal_commas_in_a_sheet,
    means_below_the_numbers,
    groups_of_thousands,
    groups_of_thousands_german,
    force_plate,
    left_leg_at_rest,
    foot_pounds_and_minutes,
]
HAVE_EMG = [
    nexus,
    labchart,
    acqknowledge,
    a_time_for_each_channel,
    matrix_with_labels,
    unit_behind_two_words,
    right_angle,
    nexus_devices_first,
    nexus_devices_last,
    left_leg_at_rest,
]
HAVE_A_COMMAND = [matrix_with_labels]
