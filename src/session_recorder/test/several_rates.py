"""Writes files in which EMG is faster than angle and torque, as most laboratories record it."""

import edfio
import numpy as np
import openpyxl
from laboratory_trial import DEG, RATE, TRIAL, N
from scipy.io import savemat

EMG_RATE = 2.0 * RATE
EMG = 2e-5 * np.random.default_rng(9).standard_normal(2 * N)
EMG_TIME = np.arange(2 * N) / EMG_RATE
EMG_MV = 1e3 * EMG


def rows(header, columns):
    """Text of columns of different length; those that end early have blank cells below."""
    longest = max(map(len, columns))
    lines = [
        ",".join(f"{c[k]:.9g}" if k < len(c) and np.isfinite(c[k]) else "" for c in columns)
        for k in range(longest)
    ]
    return "\n".join([header, *lines]) + "\n"


def delsys(path):
    header = "X[s],EMG SOL (mV),X[s],Ankle Angle (deg),X[s],Torque (Nm)"
    columns = [EMG_TIME, EMG_MV, TRIAL["t"], DEG, TRIAL["t"], TRIAL["torque"]]
    path.with_suffix(".csv").write_text(rows(header, columns))


def two_named_times(path):
    header = "Kin time (s),Ankle Angle (deg),Torque (Nm),EMG time (s),EMG SOL (mV)"
    columns = [TRIAL["t"], DEG, TRIAL["torque"], EMG_TIME, EMG_MV]
    path.with_suffix(".csv").write_text(rows(header, columns))


def blanks_at_the_slower_rate(path):
    slow = np.full((2, 2 * N), np.nan)
    slow[:, ::2] = DEG, TRIAL["torque"]
    header = "Time (s),Ankle Angle (deg),Torque (Nm),EMG SOL (mV)"
    path.with_suffix(".csv").write_text(rows(header, [EMG_TIME, *slow, EMG_MV]))


def edf_of_two_rates(path):
    signals = [
        edfio.EdfSignal(EMG_MV, EMG_RATE, label="SOL", physical_dimension="mV"),
        edfio.EdfSignal(DEG, RATE, label="Angle", physical_dimension="deg"),
        edfio.EdfSignal(TRIAL["torque"], RATE, label="Torque", physical_dimension="Nm"),
    ]
    edfio.Edf(signals).write(path.with_suffix(".edf"))


def mat_rate_of_each_structure(path):
    kin = {"angle_deg": DEG, "torque_Nm": TRIAL["torque"], "fs": RATE}
    savemat(path.with_suffix(".mat"), {"kin": kin, "emg": {"SOL_mV": EMG_MV, "fs": EMG_RATE}})


def mat_rate_by_name(path):
    held = {"angle_deg": DEG, "torque_Nm": TRIAL["torque"], "fs_kin": RATE}
    savemat(path.with_suffix(".mat"), {**held, "SOL_mV": EMG_MV, "fs_emg": EMG_RATE})


def mat_time_of_each_structure(path):
    kin = {"time": TRIAL["t"], "angle_deg": DEG, "torque_Nm": TRIAL["torque"]}
    savemat(path.with_suffix(".mat"), {"kin": kin, "emg": {"time": EMG_TIME, "SOL_mV": EMG_MV}})


MECHANICS = ["Time (s),Ankle Angle (deg),Torque (Nm)", [TRIAL["t"], DEG, TRIAL["torque"]]]
EMG_TABLE = ["Time (s),EMG SOL (mV)", [EMG_TIME, EMG_MV]]


def sheets(path, **held):
    """A workbook with a table, names and columns, on each sheet."""
    book = openpyxl.Workbook()
    book.remove(book.active)
    for title, (header, columns) in held.items():
        sheet = book.create_sheet(title)
        sheet.append(header.split(","))
        for row in zip(*columns, strict=True):
            sheet.append([float(value) for value in row])
    book.save(path.with_suffix(".xlsx"))


def below_one_another(path, *tables):
    """A text with a table below another; each is its lines above the numbers, and its columns."""
    blocks = [rows("\n".join(head), columns) for head, columns in tables]
    path.with_suffix(".csv").write_text("\n".join(blocks))


def a_sheet_for_each_rate(path):
    sheets(path, Mechanics=MECHANICS, EMG=EMG_TABLE)


def nexus_outputs_and_devices(path):
    """Vicon Nexus: what a model computes at one rate, EMG at another; rates and no times."""
    k = np.arange(len(DEG))
    outputs = ["Model Outputs", f"{RATE:.0f}", "Frame,Sub Frame,RAnkleAngles,RAnkleMoment"]
    devices = ["Devices", f"{EMG_RATE:.0f}", "Frame,Sub Frame,RSOL"]
    below_one_another(
        path,
        [[*devices, ",,V"], [np.repeat(k, 2) + 1, np.tile([0, 1], len(k)), EMG]],
        [[*outputs, ",,deg,N.mm"], [k + 1, 0 * k, DEG, 1e3 * TRIAL["torque"]]],
    )


SEVERAL_RATES = [
    delsys,
    two_named_times,
    blanks_at_the_slower_rate,
    edf_of_two_rates,
    mat_rate_of_each_structure,
    mat_rate_by_name,
    mat_time_of_each_structure,
    a_sheet_for_each_rate,
    nexus_outputs_and_devices,
]
