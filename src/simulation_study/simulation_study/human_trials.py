"""The diagnosis on the recorded human trials: ``python -m simulation_study.human_trials RECORDINGS
--out FOLDER``.

RECORDINGS holds the bags ``trial_*`` that ``ankle fetch-trials`` writes, or ``mcgill_*.npz`` with
time [s], position [rad] and torque [N.m]; the torque of these files is the subject's, opposite to
this project's sign. Prints base, augmented and explainable VAF on unseen data.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from ankle_interfaces.continuity import sampling_rate
from model_discrepancy.diagnose import diagnose
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.recording.recording import Recording


def trial_paths(folder: Path) -> list[Path]:
    """Return the bags and files of the trials in a folder.

    Raises
    ------
    DiagnosisError
        It has none.
    """
    found = sorted([*folder.glob("trial_*"), *folder.glob("mcgill_*.npz")])
    if not found:
        raise DiagnosisError(f"no bag trial_* and no mcgill_*.npz in {folder}")
    return found


def load_trial(path: Path) -> Recording:
    """Return position and torque of one trial, in this project's sign."""
    if path.is_dir():
        read = Recording.from_bag(path)
        return Recording(read.rate, read.position, read.torque, name=path.name)
    data = np.load(path)
    return Recording(
        sampling_rate(data["time"]),
        data["position"],
        -data["torque"],
        name=path.stem,
        notes=("the torque's sign was turned round",),
    )


def main() -> None:
    """Diagnose every trial of a folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    files = trial_paths(options.recordings)
    for file in files:
        begun = time.process_time()
        diagnosis = diagnose(
            load_trial(file),
            options.out / file.stem,
            progress=lambda line: print(f"  {line}", flush=True),
        )
        fit = diagnosis.verdict.fit
        names = ", ".join(
            e["name"] + (" (tentative)" if e["tentative"] else "")
            for e in diagnosis.verdict.effects
        )
        print(
            f"{file.stem}: {diagnosis.verdict.verdict}: {names}\n  VAF on unseen data: base "
            f"{fit['baseline_vaf_holdout']} %, "
            f"augmented {fit['augmented_vaf_holdout']} %, explainable "
            f"{fit['ceiling_vaf_interval']} %; whitened error cut by "
            f"{100 * fit['whitened_error_cut']:.0f} %, of the rest "
            f"{100 * fit['remaining_predictable_share']:.0f} % still predictable; "
            f"{time.process_time() - begun:.0f} s"
        )


if __name__ == "__main__":
    main()
