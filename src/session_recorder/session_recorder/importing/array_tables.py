"""Files of arrays: NPZ, MAT of every version (7.3 is HDF5), other HDF5, and MAT files whose numbers
lie in objects of Matlab classes.
"""

from __future__ import annotations

import struct
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import MatlabFunction, MatlabOpaque

from session_recorder.errors import ImportRefused
from session_recorder.importing.laboratory_units import known_unit, split_header
from session_recorder.importing.structure_rates import state_rates
from session_recorder.importing.table import Table, optional_library

HDF5_MARK = b"\x89HDF\r\n\x1a\n"
MATLAB_HEADER = 512
"""Bytes before the HDF5 mark in a MAT file of version 7.3."""
MIN_OBJECT_ROWS = 100
"""Rows of a matrix inside Matlab objects that count as recorded samples; smaller ones are
properties."""
TRANSPOSED_BELOW = 4
"""A matrix with more than this many times more columns than rows holds its signals in rows."""


def read(source: Path) -> list[Table]:
    """Read a file of arrays as one table; see `tables.read_table`.

    Raises
    ------
    ImportRefused
        It is not such a file, or HDF5 without the library.
    """
    suffix = source.suffix.lower()
    if suffix == ".npz":
        return [_table(source, _npz(source))]
    with source.open("rb") as stream:
        head = stream.read(MATLAB_HEADER + len(HDF5_MARK))
    if HDF5_MARK in (head[: len(HDF5_MARK)], head[MATLAB_HEADER:]):
        return [_table(source, _hdf5(source))]
    if suffix != ".mat":
        raise ImportRefused(f"{source} is not an HDF5 file")
    return [_mat(source)]


def _npz(source: Path) -> dict[str, Any]:
    with np.load(source, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def _mat(source: Path) -> Table:
    with warnings.catch_warnings():
        # Objects of Matlab classes have no names; their matrices are found below.
        warnings.simplefilter("ignore")
        content = loadmat(source, simplify_cells=True)
    arrays: dict[str, Any] = {}
    _flatten(content, "", arrays)
    objects = [
        n for n, value in arrays.items() if isinstance(value, (MatlabOpaque, MatlabFunction))
    ]
    table = _table(source, arrays)
    workspace = content.get("__function_workspace__")
    if workspace is not None:
        found = list(_object_matrices(np.asarray(workspace, dtype=np.uint8).tobytes()))
        for number, matrix in enumerate(found, 1):
            for k in range(matrix.shape[1]):
                table.add(f"object{number}:{k + 1}", np.ascontiguousarray(matrix[:, k]))
        if found:
            table.notes.append(
                f"{len(found)} matrices were found inside Matlab objects "
                f"({', '.join(objects) or 'unnamed'}), in the order of the file; their names and "
                "units are not readable"
            )
    return table


def _flatten(content: dict[str, Any], prefix: str, out: dict[str, Any]) -> None:
    for name, value in content.items():
        if name.startswith("__"):
            continue
        if isinstance(value, dict):
            _flatten(value, f"{prefix}{name}.", out)
        else:
            out[prefix + name] = value


def _hdf5(source: Path) -> dict[str, Any]:
    h5py: Any = optional_library("h5py", source, "MAT 7.3 and HDF5")
    arrays: dict[str, Any] = {}

    def visit(name: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset) or name.startswith("#refs#"):
            return
        if item.attrs.get("MATLAB_class") == b"cell" and item.dtype == h5py.ref_dtype:
            cells = [file[reference] for reference in item[()].reshape(-1)]
            if all(cell.attrs.get("MATLAB_class") == b"char" for cell in cells):
                arrays[name.replace("/", ".")] = [
                    "".join(map(chr, np.asarray(cell).reshape(-1))) for cell in cells
                ]
            return
        if item.dtype.kind not in "biuf":
            return
        about = item.attrs
        if about.get("MATLAB_class") == b"char" or about.get("MATLAB_empty"):
            return
        # Matlab stores columns first, HDF5 rows first.
        arrays[name.replace("/", ".")] = item[()].T if "MATLAB_class" in about else item[()]

    with h5py.File(source, "r") as file:
        file.visititems(visit)
    return arrays


def _labels(arrays: dict[str, Any], matrix: str, columns: int) -> list[str]:
    """Return the names of a matrix' columns, where a list of as many texts stands beside it.

    One of the same structure counts before others; without any, columns are numbered.
    """
    beside = matrix.rpartition(".")[0]
    found = []
    for name, value in arrays.items():
        texts = [] if isinstance(value, str) else list(np.asarray(value).reshape(-1))
        stripped = [text.strip() for text in texts if isinstance(text, str)]
        if len(texts) != columns or len(stripped) != columns or not all(stripped):
            continue
        is_units = any(known_unit(text) is not None for text in stripped)
        if len(set(stripped)) == columns and not is_units:
            found.append((name.rpartition(".")[0] != beside, stripped))
    return min(found)[1] if found else [str(k + 1) for k in range(columns)]


def _table(source: Path, arrays: dict[str, Any]) -> Table:
    table = Table(source)
    single: dict[str, float] = {}
    for name, value in arrays.items():
        array = np.asarray(value)
        if array.ndim > 2 or array.dtype.kind not in "biuf" or array.size == 0:
            continue
        if array.size == 1:
            if array.item() > 0:
                single[name] = float(array.item())
            continue
        unit = split_header(name)[1]
        if array.ndim < 2 or 1 in array.shape:
            table.add(name, np.ascontiguousarray(array.reshape(-1), dtype=float), unit)
            continue
        if array.shape[1] > TRANSPOSED_BELOW * array.shape[0]:
            array = array.T
            table.notes.append(f"{name} holds its signals in rows; they are read as columns")
        for k, label in enumerate(_labels(arrays, name, array.shape[1])):
            own = unit or split_header(label)[1]
            table.add(f"{name}:{label}", np.ascontiguousarray(array[:, k], dtype=float), own)
    state_rates(table, single)
    return table


# Elements of a MAT-5 stream (MathWorks, "MAT-File Format", section "Level 5 MAT-File Format").
_MATRIX, _COMPRESSED, _DOUBLE = 14, 15, 9
_DOUBLE_CLASS = 6
_MIN_ELEMENT = 8


def _object_matrices(workspace: bytes) -> Iterator[np.ndarray]:
    """Return real matrices of doubles with at least `MIN_OBJECT_ROWS` rows, in the order of the
    stream.

    Objects of Matlab classes are stored in a hidden workspace, itself a MAT-5 stream behind eight
    bytes of header.
    """
    yield from _elements(workspace, _MIN_ELEMENT, len(workspace))


def _elements(data: bytes, position: int, end: int) -> Iterator[np.ndarray]:
    while position + _MIN_ELEMENT <= end:
        kind, size = struct.unpack_from("<II", data, position)
        small = kind >> 16
        if small:
            position += _MIN_ELEMENT
            continue
        start, stop = position + _MIN_ELEMENT, position + _MIN_ELEMENT + size
        if stop > end:
            return
        if kind == _COMPRESSED:
            try:
                inner = zlib.decompress(data[start:stop])
            except zlib.error:
                return
            yield from _elements(inner, 0, len(inner))
            position = stop
            continue
        if kind == _MATRIX:
            matrix = _double_matrix(data, start, stop)
            if matrix is not None:
                yield matrix
            else:
                yield from _inner_matrices(data, start, stop)
        position = stop + (-size % 8)


def _inner_matrices(data: bytes, position: int, end: int) -> Iterator[np.ndarray]:
    """Return matrices inside a cell array, structure or object: its elements follow its own
    header.
    """
    while position + _MIN_ELEMENT <= end:
        kind, size = struct.unpack_from("<II", data, position)
        if kind >> 16:
            position += _MIN_ELEMENT
            continue
        if kind == _MATRIX:
            yield from _elements(data, position, min(end, position + _MIN_ELEMENT + size))
        position += _MIN_ELEMENT + size + (-size % 8)


def _double_matrix(data: bytes, position: int, end: int) -> np.ndarray | None:
    """Return the matrix in an element, None where it is of another kind or small."""
    try:
        flags_kind, flags_size, flags, _ = struct.unpack_from("<IIII", data, position)
        if flags_kind != 6 or flags_size != 8 or flags & 0xFF != _DOUBLE_CLASS or flags & 0x800:
            return None
        kind, size = struct.unpack_from("<II", data, position + 16)
        if kind != 5 or size != 8:
            return None
        rows, columns = struct.unpack_from("<ii", data, position + 24)
        name_kind, name_size = struct.unpack_from("<II", data, position + 32)
        at = position + 40 + (0 if name_kind >> 16 else name_size + (-name_size % 8))
        kind, size = struct.unpack_from("<II", data, at)
    except struct.error:
        return None
    if kind != _DOUBLE or rows < MIN_OBJECT_ROWS or columns < 1 or size != 8 * rows * columns:
        return None
    if at + 8 + size > end:
        return None
    return np.frombuffer(data, "<f8", rows * columns, at + 8).reshape(columns, rows).T
