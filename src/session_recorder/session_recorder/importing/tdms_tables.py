"""TDMS files of National Instruments."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from session_recorder.importing.laboratory_units import known_unit, split_header
from session_recorder.importing.table import Table, optional_library


def read(source: Path) -> list[Table]:
    """Read a file as one table; see `tables.read_table`.

    Channels are named ``group/channel``; by the channel's name alone where there is one group.

    Raises
    ------
    ImportRefused
        The library is not installed.
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
    return [table]
