"""Damaged files of every kind that is read."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

import edfio
import ezc3d
import nptdms
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet
import yaml
from scipy.io import savemat

from ankle_interfaces.block import Block
from ankle_physics.model import Model
from biofeedback.session import saved_session
from damaged_input.damage import (
    ROS,
    Case,
    damaged,
    text_of,
)
from session_recorder.bag_reader import BagReader
from session_recorder.bag_writer import BagWriter
from session_recorder.errors import BagError, ImportRefused
from session_recorder.importing import propose, read_table, reading_process
from session_recorder.loss import account_of_bag


def yaml_files(
    good: Any, suffix: str, read: Callable[[Path], Any], refusals: tuple[type[Exception], ...]
) -> Callable[[Path], Case]:
    """Files of YAML with a reader of their own."""

    def prepare(folder: Path) -> Case:
        path = folder / suffix

        def case(random: np.random.Generator) -> bool:
            path.write_bytes(text_of(good, random, lambda c: yaml.safe_dump(c, sort_keys=False)))
            try:
                read(path)
            except refusals:
                return False
            return True

        return case

    return prepare


def read_model(path: Path) -> None:
    """A model file; every value is within its bounds."""
    for entry in Model.load(path).entries:
        for parameter in entry.term.parameters:
            value = entry.values[parameter.symbol]
            assert parameter.lower <= value <= parameter.upper


MODEL = {
    "model": "subject 3",
    "terms": [
        {"term": "inertia", "I[kg.m^2]": {"value": 0.0137, "standard_error": 0.0002}},
        {"term": "viscosity", "B[N.m.s/rad]": 1.0},
        {"term": "stiffness", "K[N.m/rad]": 100.0},
        {"term": "reflex", "G[N.m.s/rad]": 10.0, "delay[s]": 0.04},
    ],
}
SCENARIO = {
    "scenario": "all kinds",
    "changes": [
        {"at[s]": 1, "stiffness.K[N.m/rad]": 50},
        {"at[s]": 2, "over[s]": 2, "stiffness.K[N.m/rad]": 150},
        {
            "at[s]": 5,
            "stiffness.K[N.m/rad]": {"mean": 100, "amplitude": 30, "frequency[Hz]": 0.5},
        },
    ],
}
RIG = {
    "rig": "laboratory 2",
    "calibrated": "2026-11-20T14:02:11Z",
    "bag": "rig_20261120",
    "torque_delay[s]": {"value": 0.00049, "standard_error": 0.00002},
    "zero": {"position[rad]": 0.012, "torque[N.m]": -0.31},
    "noise": {"position[rad]": 4.5e-5, "velocity[rad/s]": 6.5e-3, "torque[N.m]": 0.14},
    "terms": [{"term": "footplate_inertia", "Ip[kg.m^2]": 0.0042}],
}


def of_package(*parts: str) -> Any:
    """A YAML file of the package of the pages."""
    folder = Path(saved_session.__file__).parents[1] / "config"
    return yaml.safe_load(folder.joinpath(*parts).read_text())


def bags(folder: Path) -> Case:
    """Bags whose data or metadata are damaged: what is missing is reported."""
    good, bad, total = folder / "good", folder / "bad", 40 * 32
    with BagWriter(good, overwrite=True) as writer:
        writer.add_topic("/ankle/samples")
        for count in range(40):
            t = ROS + count * 0.032 + np.arange(32) / 1000
            writer.write_block(
                "/ankle/samples", Block(("t[s]", "torque[N.m]"), np.column_stack([t, t]))
            )
            if count % 10 == 9:
                writer.flush()
    mcap, meta = (next(good.glob(name)).read_bytes() for name in ("*.mcap", "metadata.yaml"))
    bad.mkdir(exist_ok=True)

    def case(random: np.random.Generator) -> bool:
        in_data = random.random() < 0.7
        (bad / "good_0.mcap").write_bytes(damaged(mcap, random) if in_data else mcap)
        (bad / "metadata.yaml").write_bytes(meta if in_data else damaged(meta, random))
        try:
            held = account_of_bag(BagReader(bad))
        except BagError:
            return False
        samples = sum(one.samples for one in held.topics.values())
        assert samples <= total
        assert samples == total or held.sentences()
        return True

    return case


def tables(write: Callable[[Path, np.ndarray], Path]) -> Callable[[Path], Case]:
    """Recordings in files of other programs."""

    def prepare(folder: Path) -> Case:
        t = np.arange(60) / 1000
        path = write(folder / "file", np.column_stack([t, np.sin(40 * t), np.cos(30 * t)]))
        good = path.read_bytes()

        def case(random: np.random.Generator) -> bool:
            path.write_bytes(damaged(good, random))
            try:
                found = read_table(path)
                propose(found)
            except ImportRefused:
                return False
            for name, values in found.columns.items():
                assert values.ndim == 1, name
                assert values.dtype == float
            return True

        return case

    return prepare


NAMES = ("Time (s)", "Angle (deg)", "Torque (Nm)")


def as_csv(path: Path, table: np.ndarray) -> Path:
    """Text."""
    np.savetxt(path.with_suffix(".csv"), table, delimiter=",", header=",".join(NAMES), comments="")
    return path.with_suffix(".csv")


def as_mat(path: Path, table: np.ndarray) -> Path:
    """MATLAB."""
    savemat(path.with_suffix(".mat"), {"trial": {"time": table[:, 0], "torque": table[:, 1]}})
    return path.with_suffix(".mat")


def as_edf(path: Path, table: np.ndarray) -> Path:
    """European Data Format."""
    signal = edfio.EdfSignal(np.tile(table[:, 1], 10), 600, label="SOL")
    edfio.Edf([signal]).write(path.with_suffix(".edf"))
    return path.with_suffix(".edf")


def as_xlsx(path: Path, table: np.ndarray) -> Path:
    """Excel."""
    book = openpyxl.Workbook()
    for row in (NAMES, *table.tolist()):
        book.active.append(list(row))
    book.save(path.with_suffix(".xlsx"))
    return path.with_suffix(".xlsx")


def as_parquet(path: Path, table: np.ndarray) -> Path:
    """Parquet."""
    content = pa.table({name: table[:, k] for k, name in enumerate(NAMES)})
    pyarrow.parquet.write_table(content, path.with_suffix(".parquet"))
    return path.with_suffix(".parquet")


def as_c3d(path: Path, table: np.ndarray) -> Path:
    """Motion capture."""
    file = ezc3d.c3d()
    file["parameters"]["ANALOG"]["RATE"]["value"] = [1000.0]
    file["parameters"]["ANALOG"]["LABELS"]["value"] = list(NAMES)
    file["parameters"]["POINT"]["RATE"]["value"] = [1000.0]
    file["data"]["analogs"] = table.T[np.newaxis]
    file["data"]["points"] = np.zeros((4, 0, len(table)))
    file.write(str(path.with_suffix(".c3d")))
    return path.with_suffix(".c3d")


def forked_tables(write: Callable[[Path, np.ndarray], Path]) -> Callable[[Path], Case]:
    """Tables whose reader's process is forked, because a Python that is started anew for each of
    them takes a second.
    """

    def of(folder: Path) -> Case:
        case = tables(write)(folder)

        def forked(random: np.random.Generator) -> bool:
            with mock.patch.object(reading_process.subprocess, "run", _run_forked):
                return case(random)

        return forked

    return of


def _run_forked(command: list[str], **options: Any) -> subprocess.CompletedProcess[bytes]:
    """Run the reader of a file in a copy of this process."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        child = os.fork()
        if not child:
            os.dup2(out.fileno(), 1)
            os.dup2(err.fileno(), 2)
            sys.argv = command[2:]
            sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")
            failed = reading_process.main()
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(failed)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        out.seek(0)
        err.seek(0)
        return subprocess.CompletedProcess(command, code, out.read(), err.read())


def as_tdms(path: Path, table: np.ndarray) -> Path:
    """LabVIEW."""
    with nptdms.TdmsWriter(path.with_suffix(".tdms")) as writer:
        writer.write_segment(
            [nptdms.ChannelObject("rig", name, table[:, k]) for k, name in enumerate(NAMES)]
        )
    return path.with_suffix(".tdms")
