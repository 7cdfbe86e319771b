"""Columns of numbers from CSV, NPZ, MAT, EDF and BDF files."""

from __future__ import annotations

import csv
import io
import zipfile
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat

from session_recorder.edf_tables import EDF_SUFFIXES, read_edf
from session_recorder.errors import ImportRefused

# What programs write for a value that is not there.
MISSING = frozenset({"", "nan", "na", "n/a", "null", "none", "-"})
DELIMITERS = ",;\t "


def read_table(
    path: Path | str, wanted: Collection[str]
) -> tuple[dict[str, np.ndarray], list[str]]:
    """Named columns of a file, as float64 of shape (n,); a missing cell is NaN.

    CSV columns go by their header, or by number from ``1`` where the first line holds numbers.
    Arrays of NPZ and MAT go by their name, fields of a structure by ``name.field``, the columns of
    a two-dimensional array by ``name:1``, ``name:2``, ... Signals of EDF and BDF go by their label,
    the time since the start is ``t``.

    Parameters
    ----------
    wanted
        Column names.

    Returns
    -------
    tuple[dict[str, np.ndarray], list[str]]
        The wanted columns, and the names of those that are there and not wanted.

    Raises
    ------
    ImportRefused
        No such file or column, not a format that is read, a cell that is no number, columns of
        different length.
    """
    source = Path(path)
    readers: dict[
        str, Callable[[Path, Collection[str]], tuple[dict[str, np.ndarray], list[str]]]
    ] = {
        ".csv": _read_csv,
        ".txt": _read_csv,
        ".npz": _read_npz,
        ".mat": _read_mat,
        **dict.fromkeys(EDF_SUFFIXES, read_edf),
    }
    read = readers.get(source.suffix.lower())
    if read is None:
        raise ImportRefused(
            f"{source}: '{source.suffix}' is not read; expected one of {', '.join(readers)}"
        )
    try:
        columns, names = read(source, wanted)
    except OSError as error:
        raise ImportRefused(f"{source}: {error.strerror or error}") from None
    lengths = {name: len(column) for name, column in columns.items()}
    if len(set(lengths.values())) > 1:
        raise ImportRefused(
            f"{source}: columns of different length: "
            f"{', '.join(f'{name} {n}' for name, n in lengths.items())}"
        )
    return columns, [name for name in names if name not in columns]


def _choose(source: Path, available: dict[str, Any], wanted: Collection[str]) -> None:
    for name in wanted:
        if name not in available:
            raise ImportRefused(
                f"{source} has no column '{name}'; it holds {', '.join(available) or 'none'}"
            )


def _read_csv(source: Path, wanted: Collection[str]) -> tuple[dict[str, np.ndarray], list[str]]:
    try:
        text = source.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise ImportRefused(f"{source} is not text in UTF-8") from None
    first = text.partition("\n")[0]
    if not first.strip():
        raise ImportRefused(f"{source}: the first line is empty; expected column names or numbers")
    delimiter = max(DELIMITERS, key=first.count)
    cells = [
        cell.strip()
        for cell in next(csv.reader([first], delimiter=delimiter, skipinitialspace=True))
    ]
    has_header = any(_number(cell) is None for cell in cells)
    names = cells if has_header else [str(number + 1) for number in range(len(cells))]
    doubled = {name for name in names if names.count(name) > 1}
    if doubled & set(wanted):
        raise ImportRefused(f"{source}: more than one column is named {', '.join(sorted(doubled))}")
    _choose(source, dict.fromkeys(names), wanted)
    index = [names.index(name) for name in wanted]
    options: dict[str, Any] = {
        "delimiter": None if delimiter == " " else delimiter,
        "skiprows": int(has_header),
        "usecols": index,
        "ndmin": 2,
    }
    try:
        data = np.loadtxt(io.StringIO(text), **options)
    except ValueError:
        data = _read_cells(
            source,
            text,
            delimiter,
            int(has_header),
            {i: name for i, name in zip(index, wanted, strict=True)},
        )
    return {name: np.ascontiguousarray(data[:, k]) for k, name in enumerate(wanted)}, names


def _number(cell: str) -> float | None:
    if cell.strip().lower() in MISSING:
        return float("nan")
    try:
        return float(cell)
    except ValueError:
        return None


def _read_cells(
    source: Path, text: str, delimiter: str, skip: int, columns: dict[int, str]
) -> np.ndarray:
    """Cell by cell, so that an empty one becomes NaN and a wrong one is named."""
    rows = []
    reader = csv.reader(io.StringIO(text), delimiter=delimiter, skipinitialspace=True)
    for number, row in enumerate(reader):
        if number < skip or not row:
            continue
        values = []
        for index, name in columns.items():
            cell = row[index] if index < len(row) else ""
            value = _number(cell)
            if value is None:
                raise ImportRefused(
                    f"{source}, line {reader.line_num}: '{cell}' in column '{name}' is not a number"
                )
            values.append(value)
        rows.append(values)
    return np.array(rows, dtype=float).reshape(len(rows), len(columns))


def _read_npz(source: Path, wanted: Collection[str]) -> tuple[dict[str, np.ndarray], list[str]]:
    try:
        with np.load(source, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except (ValueError, zipfile.BadZipFile, EOFError) as error:
        raise ImportRefused(f"{source} is not a readable NPZ file of numbers: {error}") from None
    return _from_arrays(source, arrays, wanted)


def _read_mat(source: Path, wanted: Collection[str]) -> tuple[dict[str, np.ndarray], list[str]]:
    try:
        content = loadmat(source, simplify_cells=True)
    except FileNotFoundError:
        raise
    except NotImplementedError:
        raise ImportRefused(
            f"{source} is a MATLAB 7.3 file; save it with save(..., '-v7')"
        ) from None
    except Exception as error:  # scipy raises a dozen kinds on damaged files
        raise ImportRefused(
            f"{source} is not a readable MAT file: {error or type(error).__name__}"
        ) from None
    arrays: dict[str, Any] = {}
    _flatten(content, "", arrays)
    return _from_arrays(source, arrays, wanted)


def _flatten(content: dict[str, Any], prefix: str, out: dict[str, Any]) -> None:
    for name, value in content.items():
        if name.startswith("__"):
            continue
        if isinstance(value, dict):
            _flatten(value, f"{prefix}{name}.", out)
        else:
            out[prefix + name] = value


def _from_arrays(
    source: Path, arrays: dict[str, Any], wanted: Collection[str]
) -> tuple[dict[str, np.ndarray], list[str]]:
    columns: dict[str, np.ndarray] = {}
    for name, value in arrays.items():
        array = np.asarray(value)
        if array.ndim > 2 or array.dtype.kind not in "biuf" or array.size == 0:
            continue
        if array.ndim < 2 or 1 in array.shape:
            columns[name] = np.ascontiguousarray(array.reshape(-1), dtype=float)
        else:
            columns.update(
                {
                    f"{name}:{k + 1}": np.ascontiguousarray(array[:, k], dtype=float)
                    for k in range(array.shape[1])
                }
            )
    _choose(source, columns, wanted)
    return {name: columns[name] for name in wanted}, list(columns)
