"""Columns of EDF, EDF+, BDF and BDF+ files, in which EMG amplifiers store recordings (Kemp & Olivan
2003); read by `edfio`.
"""

from __future__ import annotations

from pathlib import Path

import edfio
import numpy as np

from session_recorder.errors import ImportRefused
from session_recorder.importing.laboratory_units import known_unit
from session_recorder.importing.table import Table


def read(source: Path) -> list[Table]:
    """Read signals by their label, in the unit that the file declares, as one table.

    Raises
    ------
    ImportRefused
        Not such a file, or gaps in the recording.
    """
    file = edfio.read_bdf(source) if source.suffix.lower() == ".bdf" else edfio.read_edf(source)
    if not file.is_continuous:
        raise ImportRefused(
            f"{source} is a discontinuous recording (EDF+D); its gaps would be lost, export each "
            "part by itself"
        )
    table = Table(source)
    for signal in file.signals:
        unit = signal.physical_dimension
        table.add(
            signal.label,
            np.asarray(signal.data, dtype=float),
            known_unit(unit) or unit or None,
            float(signal.sampling_frequency),
        )
    return [table]
