"""A diagnosis runs in a process of its own.

It sees the bag and a folder to write to, and not the truth.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import yaml

from simulation_study.blind.concealment import concealed

RUN_FILE = "run.json"
RESULT_FOLDER = "diagnosis"
# A search path into the tests would be a way to the adversary's code. Dask makes its workers give
# memory back at once, which costs more time in the kernel than the diagnosis takes.
_HIDDEN_VARIABLES = ("PYTHONPATH", "MALLOC_TRIM_THRESHOLD_")


def diagnose_case(
    command: list[str], bag: Path, folder: Path, hidden: list[Path], time_limit: float
) -> dict[str, Any]:
    """Run the diagnosing command on one bag.

    Parameters
    ----------
    command
        Words in which ``{bag}`` and ``{out}`` are replaced.
    bag
        To diagnose.
    folder
        Receives ``diagnosis/`` (what the command writes), ``log.txt`` and, at last, ``run.json``.
    hidden
        Folders that the process must not see; empty runs it unconfined.
    time_limit
        [s], after which the process and its children are ended.

    Returns
    -------
    dict[str, Any]
        Content of ``run.json``: exit code (None after the time limit) and duration [s].
    """
    out, scratch = folder / RESULT_FOLDER, folder / "scratch"
    # What an interrupted run left is not a result.
    for leftover in (out, scratch):
        shutil.rmtree(leftover, ignore_errors=True)
    scratch.mkdir(parents=True)
    words = [
        word.replace("{bag}", str(bag.resolve())).replace("{out}", str(out.resolve()))
        for word in command
    ]
    environment = {key: value for key, value in os.environ.items() if key not in _HIDDEN_VARIABLES}
    # A confined process may not write to folders on the way to the truth, so its temporary files
    # get a place.
    environment |= {
        "TMPDIR": str(scratch),
        "MPLCONFIGDIR": str(scratch),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
    begin = time.monotonic()
    with (folder / "log.txt").open("wb") as log:
        process = subprocess.Popen(
            concealed(words, hidden) if hidden else words,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            cwd=folder,
            env=environment,
            start_new_session=True,
        )
        try:
            code: int | None = process.wait(timeout=time_limit)
        except subprocess.TimeoutExpired:
            code = None
        finally:
            # The session that was started above, and nothing else.
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    shutil.rmtree(scratch, ignore_errors=True)
    done = {"exit": code, "seconds": time.monotonic() - begin}
    half = folder / (RUN_FILE + ".half")
    half.write_text(json.dumps(done))
    half.replace(folder / RUN_FILE)
    return done


def is_diagnosed(folder: Path) -> bool:
    """Say whether the case was diagnosed to its end, with whatever result."""
    return (folder / RUN_FILE).exists()


def read_verdict(folder: Path) -> tuple[dict[str, Any] | None, dict[str, Any] | None]:
    """Read ``verdict.json`` and ``model.yaml`` of a diagnosed case; None for what is missing or
    unreadable.
    """
    verdict: dict[str, Any] | None = None
    model: dict[str, Any] | None = None
    with contextlib.suppress(OSError, ValueError):
        verdict = json.loads((folder / RESULT_FOLDER / "verdict.json").read_text())
    with contextlib.suppress(OSError, yaml.YAMLError):
        model = yaml.safe_load((folder / RESULT_FOLDER / "model.yaml").read_text())
    return (verdict if isinstance(verdict, dict) else None), (
        model if isinstance(model, dict) else None
    )
