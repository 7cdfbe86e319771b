"""The diagnosis on the recorded human trials: ``python -m simulation_study.human_trials RECORDINGS
--out FOLDER``.

RECORDINGS holds the bags ``trial_*`` that ``ankle fetch-trials`` writes, or ``mcgill_*.npz`` with
time [s], position [rad] and torque [N.m]; the torque of these files is the subject's, opposite to
this project's sign. Prints base, augmented and explainable VAF on unseen data. Where the models of
two trials or more hold the error of the measured angle, ``angle_errors.png`` shows their curves,
and their correlation is printed.
"""

from __future__ import annotations

import argparse
import time
from itertools import combinations
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ankle_interfaces.continuity import sampling_rate
from model_discrepancy.diagnose import diagnose
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.recording.recording import Recording
from model_discrepancy.report.angle_error import angle_curve

# Angles, angle error and its standard error [rad], as `angle_curve` gives them.
Curve = tuple[np.ndarray, np.ndarray, np.ndarray]


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


def correlation(first: Curve, second: Curve) -> float:
    """Return the correlation of two curves at the same distance from the middle of their ranges, as
    far as both reach.
    """
    half = 0.5 * min(float(np.ptp(angles)) for angles, _, _ in (first, second))
    places = np.linspace(-half, half, len(first[0]))
    one, other = (
        np.interp(places, angles - angles.mean(), error) for angles, error, _ in (first, second)
    )
    return float(np.corrcoef(one, other)[0, 1])


def draw(curves: dict[str, Curve], path: Path) -> None:
    """Draw the angle error of several trials with their 95 % bands, over the distance from the
    middle of their ranges.
    """
    figure = Figure(figsize=(7, 3.2))
    axes = figure.add_subplot()
    for name, (angles, error, spread) in curves.items():
        away = 1000 * (angles - angles.mean())
        (line,) = axes.plot(away, 1000 * error, label=name.replace("_", " "))
        low, high = 1000 * (error - 1.96 * spread), 1000 * (error + 1.96 * spread)
        axes.fill_between(away, low, high, color=line.get_color(), alpha=0.2, lw=0)
    axes.axhline(0.0, color="0.5", lw=0.8)
    axes.set_xlabel("measured angle less its mean [mrad]")
    axes.set_ylabel("plate less measured angle [mrad]")
    axes.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main() -> None:
    """Diagnose every trial of a folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    files = trial_paths(options.recordings)
    curves: dict[str, Curve] = {}
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
        found, problem = diagnosis.found, diagnosis.problem
        if found is not None and problem is not None and "uneven_angle" in found.final.terms:
            curves[file.stem] = angle_curve(problem.fitter, found.final)
    if len(curves) > 1:
        draw(curves, options.out / "angle_errors.png")
        for first, second in combinations(curves, 2):
            alike = correlation(curves[first], curves[second])
            print(f"angle errors of {first} and {second}: correlation {alike:.2f}")


if __name__ == "__main__":
    main()
