"""Files of measuring devices: C3D of motion capture, TDMS of National Instruments."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from session_recorder.errors import ImportRefused
from session_recorder.importing.c3d_process import read_c3d
from session_recorder.importing.laboratory_units import known_unit, split_header
from session_recorder.importing.tables import Table, optional_library


def read(source: Path) -> list[Table]:
    """Read a device's file as one table; see `tables.read_table`.

    Raises
    ------
    ImportRefused
        It is not such a file, or its library is not installed.
    """
    return [_c3d(source) if source.suffix.lower() == ".c3d" else _tdms(source)]


def _c3d(source: Path) -> Table:
    """Return analog channels by label, coordinates of markers as ``label:x``, ``label:y``,
    ``label:z``.
    """
    optional_library("ezc3d", source, "C3D")
    with source.open("rb") as stream:
        if stream.read(2)[1:] != b"\x50":
            raise ImportRefused(f"{source} is not a C3D file: its second byte is not 0x50")
    content = read_c3d(source)
    labels, units, markers = (list(content[name]) for name in ("labels", "units", "markers"))
    signals, points = content["analogs"], content["points"]
    rate, point_rate = float(content["analog_rate"]), float(content["point_rate"])
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
    return table


def _tdms(source: Path) -> Table:
    """Return channels as ``group/channel``; by the channel's name alone where there is one
    group.
    """
    nptdms: Any = optional_library("nptdms:npTDMS", source, "TDMS")
    groups = nptdms.TdmsFile.read(source).groups()
    channels = [
        (group.name, channel.name, channel[:], dict(channel.properties))
        for group in groups
        for channel in group.channels()
    ]
    table = Table(source)
    for group, channel, values, properties in channels:
        name = channel if len(groups) == 1 else f"{group}/{channel}"
        data = np.asarray(values)
        if data.dtype.kind == "M":
            data = (data - data[0]) / np.timedelta64(1, "s") if len(data) else data.astype(float)
        if data.dtype.kind not in "biuf" or not len(data):
            table.refused[name] = f"{source}: channel '{name}' holds no numbers"
            continue
        declared = known_unit(str(properties.get("unit_string", "")))
        step = properties.get("wf_increment")
        rate = 1.0 / step if isinstance(step, float) and step > 0 else None
        table.add(name, data.astype(float), declared or split_header(name)[1], rate)
    return table
