"""Columns of EDF, EDF+, BDF and BDF+ files, in which EMG amplifiers store recordings (Kemp & Olivan
2003); read by `edfio`.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import edfio
import numpy as np

from session_recorder.errors import ImportRefused

EDF_SUFFIXES = (".edf", ".bdf")
TIME = "t"
"""Name of the column with the time since the start [s], which the file's sampling rate gives."""


def _open(source: Path) -> edfio.Edf | edfio.Bdf:
    try:
        return edfio.read_bdf(source) if source.suffix.lower() == ".bdf" else edfio.read_edf(source)
    except FileNotFoundError:
        raise
    except Exception as error:  # a damaged header gives errors of many kinds
        raise ImportRefused(
            f"{source} is not a readable EDF or BDF file: {error or type(error).__name__}"
        ) from None


def read_edf(source: Path, wanted: Collection[str]) -> tuple[dict[str, np.ndarray], list[str]]:
    """Signals by their label, in the unit that the file declares, and `TIME`; see
    `tables.read_table`.

    Raises
    ------
    ImportRefused
        Not such a file, a signal that is not there or there twice, signals of different rates, or
        gaps in the recording.
    """
    file = _open(source)
    if not file.is_continuous:
        raise ImportRefused(
            f"{source} is a discontinuous recording (EDF+D); its gaps would be lost, export each "
            "part by itself"
        )
    labels = list(file.labels)
    signals = {}
    for name in wanted:
        if labels.count(name) != 1 and name != TIME:
            found = "more than one signal" if name in labels else "no signal"
            raise ImportRefused(
                f"{source} has {found} '{name}'; it holds {TIME}, {', '.join(labels)}"
            )
        if name in labels:
            signals[name] = file.get_signal(name)
    rates = {name: signal.sampling_frequency for name, signal in signals.items()}
    if len(set(rates.values())) != 1:
        raise ImportRefused(
            f"{source}: the signals have different sampling rates: "
            f"{', '.join(f'{n} {r:g} Hz' for n, r in rates.items())}"
        )
    columns = {name: np.asarray(signal.data, dtype=float) for name, signal in signals.items()}
    if TIME in wanted and TIME not in columns:
        columns[TIME] = np.arange(len(next(iter(columns.values())))) / next(iter(rates.values()))
    return columns, labels


def edf_units(source: Path) -> dict[str, str]:
    """Unit that the file declares for each signal, by label; empty for other formats."""
    if source.suffix.lower() not in EDF_SUFFIXES:
        return {}
    return {signal.label: signal.physical_dimension for signal in _open(source).signals}
