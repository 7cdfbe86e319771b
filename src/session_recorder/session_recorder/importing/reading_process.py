"""Reads a file in a process of its own, with a library that damaged files make hang or crash.

python -m session_recorder.importing.reading_process MODULE FILE > TABLES
"""

from __future__ import annotations

import math
import os
import pickle
import resource
import signal
import subprocess
import sys
from importlib import import_module
from pathlib import Path

from session_recorder.errors import ImportRefused
from session_recorder.importing.table import Table

LONGEST_READING = 5.0
"""[s] Processor time of the reading of a small file: a library takes one second to load."""
LONGEST_READING_OF_A_BYTE = 1e-7
"""[s] Further processor time for each byte: ten times what a file of 100 MB takes."""
WALL_TIME_RATIO = 12.0
"""Multiple of the processor time after which a reading on a busy computer is given up."""
MOST_MEMORY = 2**31
"""[bytes] Address space of the reading of a small file; a damaged header may ask for any number of
samples, and a computer without memory stands still."""
MEMORY_OF_A_BYTE = 30
"""Further address space for each byte: numbers of 2 bytes become several copies of 8 bytes."""
REFUSED_CODE = 3
"""Exit code of a reading that was refused with a whole sentence."""


def read_apart(source: Path, module: str) -> list[Table]:
    """Read a file as a module of this package does, in a process of its own.

    Parameters
    ----------
    source
        The file.
    module
        Name of a module of this package with a function ``read``.

    Returns
    -------
    list[Table]
        What ``read`` returns.

    Raises
    ------
    ImportRefused
        ``read`` refuses the file or fails, or its process hangs or crashes.
    """
    unreadable = f"{source} is not a readable '{source.suffix}' file"
    try:
        found = subprocess.run(
            [sys.executable, "-m", __name__, module, str(source)],
            capture_output=True,
            stdin=subprocess.DEVNULL,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
            timeout=WALL_TIME_RATIO * _longest_reading(source),
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise ImportRefused(f"{unreadable}: its reader hangs") from None
    said = found.stderr.decode(errors="replace").strip()
    if found.returncode == REFUSED_CODE:
        raise ImportRefused(said)
    if found.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        raise ImportRefused(
            f"{unreadable}: its reader took more than {_longest_reading(source):.0f} s"
        )
    if found.returncode < 0:
        name = signal.Signals(-found.returncode).name
        raise ImportRefused(f"{unreadable}: its reader crashed ({name})")
    if found.returncode:
        raise ImportRefused(f"{unreadable}: {said.splitlines()[-1] if said else 'no reason given'}")
    tables: list[Table] = pickle.loads(found.stdout)
    return tables


def _longest_reading(source: Path) -> float:
    return LONGEST_READING + LONGEST_READING_OF_A_BYTE * source.stat().st_size


def main() -> int:
    """Read one file and write its tables to the standard output."""
    module, source = sys.argv[1], Path(sys.argv[2])
    longest = math.ceil(_longest_reading(source))
    resource.setrlimit(resource.RLIMIT_CPU, (longest, longest))
    memory = MOST_MEMORY + MEMORY_OF_A_BYTE * source.stat().st_size
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    try:
        tables = import_module(f"session_recorder.importing.{module}").read(source)
    except ImportRefused as refusal:
        print(refusal, file=sys.stderr)
        return REFUSED_CODE
    except Exception as error:  # whatever the library says of the file
        print(error or type(error).__name__, file=sys.stderr)
        return 1
    sys.stdout.buffer.write(pickle.dumps(tables))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
