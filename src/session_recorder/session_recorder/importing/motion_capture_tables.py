"""C3D files of motion capture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from session_recorder.errors import ImportRefused
from session_recorder.importing.laboratory_units import known_unit, split_header
from session_recorder.importing.table import Table, optional_library


def read(source: Path) -> list[Table]:
    """Read a file as one table; see `tables.read_table`.

    Analog channels are named by their label, coordinates of markers ``label:x``, ``label:y``,
    ``label:z``.

    Raises
    ------
    ImportRefused
        It is not such a file, or its library is not installed.
    """
    ezc3d: Any = optional_library("ezc3d", source, "C3D")
    with source.open("rb") as stream:
        if stream.read(2)[1:] != b"\x50":
            raise ImportRefused(f"{source} is not a C3D file: its second byte is not 0x50")
    content = ezc3d.c3d(str(source))
    analog, header = content["parameters"]["ANALOG"], content["header"]
    labels = list(analog["LABELS"]["value"] if "LABELS" in analog else [])
    units = list(analog["UNITS"]["value"] if "UNITS" in analog else [])
    markers = list(content["parameters"]["POINT"]["LABELS"]["value"])
    signals, points = content["data"]["analogs"], content["data"]["points"]
    rate = float(header["analogs"]["frame_rate"])
    point_rate = float(header["points"]["frame_rate"])
    table = Table(source)
    for index in range(signals.shape[1] if signals.size else 0):
        name = str(labels[index]).strip() if index < len(labels) else str(index + 1)
        declared = known_unit(str(units[index])) if index < len(units) else None
        values = np.array(signals[0, index], dtype=float)
        table.add(name, values, declared or split_header(name)[1], rate)
    for index, marker in enumerate(markers[: points.shape[1]]):
        for axis, letter in enumerate("xyz"):
            name = f"{marker.strip()}:{letter}"
            table.add(name, np.array(points[axis, index], dtype=float), None, point_rate)
    return [table]
