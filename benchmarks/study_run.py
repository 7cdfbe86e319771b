"""What a study of many recordings costs: ``ankle study run`` on simulated visits, estimates only.

    python benchmarks/study_run.py FOLDER --recordings 100 --seconds 25 --workers 1

The recordings are made first and are not part of the time. FOLDER keeps the study, so that a second
call is the time of a run in which everything is done already.
"""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path

from session_analysis.study.layout import Study, init_study
from session_analysis.study.running import run_study
from session_analysis.virtual_study import FINAL_PERTURBATION_TIME, VirtualSession, record_session

VISITS = 5
"""Recordings of a subject: enough for a test-retest table."""
APPROACH_TIME = 4.0
"""[s] Time on the way to the one hold of a recording."""


def make_study(folder: Path, recordings: int, seconds: float) -> Study:
    """Make a study of simulated visits, or open the one that is there."""
    if (folder / "study.yaml").exists():
        return Study(folder)
    study = init_study(folder, "what a study costs")
    for number in range(recordings):
        subject, visit = divmod(number, VISITS)
        entry = study.next_entry(f"S{subject + 1:03d}", visit + 1)
        study.add(entry, {"body_mass[kg]": 75.0, "mvc_plantarflexion[N.m]": 100.0})
        record_session(
            VirtualSession(
                subject + 1,
                (1, 0),
                False,
                visit + 1,
                hold=seconds - APPROACH_TIME - FINAL_PERTURBATION_TIME,
                reach=APPROACH_TIME,
            ),
            entry.source,
        )
        print(f"\rrecorded {number + 1} of {recordings}", end="", flush=True)
    print()
    return study


def main() -> None:
    """Run a study and print what it cost."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--recordings", type=int, default=100)
    parser.add_argument("--seconds", type=float, default=25.0)
    parser.add_argument("--workers", type=int, default=1)
    asked = parser.parse_args()
    study = make_study(asked.folder, asked.recordings, asked.seconds)
    began, load = time.perf_counter(), os.times()
    rows, failures = run_study(
        study, asked.workers, diagnosed=False, progress=lambda name, share: print(name, flush=True)
    )
    took, after = time.perf_counter() - began, os.times()
    processor = sum(after[2:4]) - sum(load[2:4])
    count = len(study.entries())
    print(
        f"{count} recordings of {asked.seconds:g} s with {asked.workers} worker(s): {took:.0f} s, "
        f"{took / count:.2f} s each; {processor / count:.2f} s of processor time each "
        f"({asked.seconds * count / max(processor, 1e-9):.0f} times real time per core); "
        f"{len(rows)} numbers, {len(failures)} failures"
    )


if __name__ == "__main__":
    main()
