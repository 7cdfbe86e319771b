"""Reads a C3D file in a process of its own: damaged files make its library hang or end the process.

python -m session_recorder.importing.c3d_process FILE > ARRAYS
"""

from __future__ import annotations

import io
import math
import os
import resource
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from session_recorder.errors import ImportRefused

LONGEST_READING = 5.0
"""[s] Processor time of the reading of a small file: its library takes one second to load."""
LONGEST_READING_OF_A_BYTE = 1e-7
"""[s] Further processor time for each byte: ten times what a file of 100 MB takes."""
WALL_TIME_RATIO = 12.0
"""Multiple of the processor time after which a reading on a busy computer is given up."""
MOST_MEMORY = 2**30
"""[bytes] Address space of the reading of a small file; a damaged header may ask for any number of
samples, and a computer without memory stands still."""
MEMORY_OF_A_BYTE = 30
"""Further address space for each byte: numbers of 2 bytes become several copies of 8 bytes."""


def read_c3d(source: Path) -> dict[str, np.ndarray]:
    """Return what a C3D file holds.

    Returns
    -------
    dict
        ``analogs`` of shape (1, channels, n), ``points`` of shape (4, markers, frames), texts
        ``labels``, ``units`` and ``markers``, numbers ``analog_rate`` and ``point_rate`` [Hz].

    Raises
    ------
    ImportRefused
        The library cannot read it.
    """
    try:
        found = subprocess.run(
            [sys.executable, "-m", __name__, str(source)],
            capture_output=True,
            stdin=subprocess.DEVNULL,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
            timeout=WALL_TIME_RATIO * _longest_reading(source),
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise ImportRefused(f"{source} cannot be read as C3D: its reader hangs") from None
    if found.returncode:
        lines = found.stderr.decode(errors="replace").strip().splitlines()
        reason = lines[-1] if lines else f"its reader ended with {found.returncode}"
        if found.returncode in (-signal.SIGXCPU, -signal.SIGKILL) and not lines:
            reason = f"its reader took more than {_longest_reading(source):.0f} s"
        raise ImportRefused(f"{source} cannot be read as C3D: {reason}")
    with np.load(io.BytesIO(found.stdout)) as arrays:
        return dict(arrays)


def _longest_reading(source: Path) -> float:
    return LONGEST_READING + LONGEST_READING_OF_A_BYTE * source.stat().st_size


def _arrays(content: Any) -> dict[str, Any]:
    """Return what `read_c3d` returns."""
    analog = content["parameters"]["ANALOG"]
    return {
        "analogs": content["data"]["analogs"],
        "points": content["data"]["points"],
        "labels": np.array(analog["LABELS"]["value"] if "LABELS" in analog else [], dtype=str),
        "units": np.array(analog["UNITS"]["value"] if "UNITS" in analog else [], dtype=str),
        "markers": np.array(content["parameters"]["POINT"]["LABELS"]["value"], dtype=str),
        "analog_rate": float(content["header"]["analogs"]["frame_rate"]),
        "point_rate": float(content["header"]["points"]["frame_rate"]),
    }


def main() -> int:
    """Read one file and write its arrays to the standard output."""
    longest = math.ceil(_longest_reading(Path(sys.argv[1])))
    resource.setrlimit(resource.RLIMIT_CPU, (longest, longest))
    memory = MOST_MEMORY + MEMORY_OF_A_BYTE * Path(sys.argv[1]).stat().st_size
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    import ezc3d

    try:
        arrays = _arrays(ezc3d.c3d(sys.argv[1]))
    except Exception as error:  # whatever the library says of the file
        print(error, file=sys.stderr)
        return 1
    out = io.BytesIO()
    np.savez(out, **arrays)
    sys.stdout.buffer.write(out.getvalue())
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
