"""Removes each control of driver and rig in turn: a test of the default suite has to notice.

    make mutants                       all of them, in a copy of both packages
    python mutants.py WORDS...         those whose name has one of the words
    python mutants.py --jobs 2

Each mutant is one change of source and names the tests of which one has to fail then. The command
ends with 1 where a mutant survives.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from removed_controls import MUTANTS, Mutant

ROOT = Path(__file__).resolve().parents[3]
TESTS = "src/ankle_actuator_driver/test/"
CPU_TIME_LIMIT = 120  # s of processor time for one mutant: a test that hangs has noticed, too
WALL_TIME_LIMIT = 3600.0  # s for a machine that is busy with something else


def broken(mutant: Mutant, folder: Path) -> str:
    """The source without its control; raises where it is not found exactly once."""
    source = (folder / mutant.file).read_text()
    if source.count(mutant.control) != 1:
        raise ValueError(
            f"'{mutant.name}': {source.count(mutant.control)} places in {mutant.file} are\n"
            f"{mutant.control}"
        )
    return source.replace(mutant.control, mutant.without)


def _limit_processor_time() -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_TIME_LIMIT, CPU_TIME_LIMIT + 5))


def run(mutant: Mutant) -> tuple[Mutant, str]:
    """Return what became of a mutant: killed, killed because a test hangs, or survived."""
    with tempfile.TemporaryDirectory(prefix="mutant_") as name:
        copy = Path(name)
        for package in ("ankle_actuator_driver", "rig_emulator"):
            shutil.copytree(ROOT / "src" / package, copy / "src" / package)
        shutil.copytree(ROOT / "docs", copy / "docs")
        (copy / mutant.file).write_text(broken(mutant, copy))
        file, _, words = mutant.killer.partition(":")
        paths = [
            str(copy / "src" / package) for package in ("ankle_actuator_driver", "rig_emulator")
        ]
        command = [sys.executable, "-m", "pytest", "-q", "-x", "-n", "0", "-p", "no:cacheprovider"]
        command += [
            "--import-mode=importlib",
            "-m",
            "not slow",
            "-k",
            words,
            str(copy / TESTS / file),
        ]
        command += ["-c", str(ROOT / "pyproject.toml"), "--rootdir", str(copy)]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
        try:
            found = subprocess.run(
                command,
                cwd=copy,
                env=environment,
                capture_output=True,
                text=True,
                timeout=WALL_TIME_LIMIT,
                check=False,
                preexec_fn=_limit_processor_time,
            )
        except subprocess.TimeoutExpired:
            return mutant, f"ERROR: not decided within {WALL_TIME_LIMIT:g} s"
    if found.returncode == -signal.SIGXCPU:
        return mutant, "killed (hangs)"
    if found.returncode == 1:
        return mutant, "killed"
    return mutant, "SURVIVED" if found.returncode == 0 else f"ERROR: {found.stdout[-300:]}"


def main() -> int:
    """Run and print a table."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("words", nargs="*")
    options.add_argument("--jobs", type=int, default=2)
    given = options.parse_args()
    chosen = [m for m in MUTANTS if not given.words or any(w in m.name for w in given.words)]
    alive = 0
    print("| control removed | in | test | |\n| --- | --- | --- | --- |")
    with ThreadPoolExecutor(given.jobs) as pool:
        for mutant, fate in pool.map(run, chosen):
            alive += not fate.startswith("killed")
            file = mutant.file.rpartition("/")[2]
            print(f"| {mutant.name} | {file} | {mutant.killer} | {fate} |", flush=True)
    print(f"\n{len(chosen) - alive} of {len(chosen)} mutants killed")
    return int(alive > 0)


if __name__ == "__main__":
    raise SystemExit(main())
