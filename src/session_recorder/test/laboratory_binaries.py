"""Writes tables and binary files as laboratories have them, each of which is imported."""

import edfio
import h5py
import nptdms
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet
import pytest
from laboratory_trial import DEG, RATE, TRIAL, N
from scipy.io import savemat


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


BINARIES = [
    xlsx,
    parquet,
    mat_struct,
    mat_with_rate,
    mat_73,
    tdms,
    c3d,
    edf_mechanics,
]
