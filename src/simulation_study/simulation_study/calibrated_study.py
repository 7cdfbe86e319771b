"""Rig and session calibrated, then estimated online: ``python -m simulation_study.calibrated_study
--recordings 30 --seed 1 --out FOLDER``.

Every recording is of the independent MuJoCo rig: two minutes with the plate empty, from which
``rig.yaml`` is made, and two minutes of a subject. The session is calibrated on the subject's first
minute (``subject.yaml``), and the second one is estimated online without either file, with the
rig's, and with both. FOLDER keeps recordings, files and estimates, so that an interrupted study
goes on where it stopped and a changed estimator is judged on the same files; it receives
``calibrated.md``.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from ankle_physics.errors import ModelError
from ankle_physics.model import Model
from ankle_physics.rig_file import RigFile
from blind_rig.magnitudes import MAGNITUDES
from calibration.errors import CalibrationError
from calibration.session_calibration import calibrate_session, require_gain
from impedance_estimator.estimator import ESTIMATE_COLUMNS
from impedance_estimator.known_physics import KnownPhysics
from impedance_estimator.offline.recorded_estimates import estimate_signal
from impedance_estimator.simultaneous.doubt import DOUBT_THRESHOLD
from model_discrepancy.recording.recording import Recording
from simulation_study.calibrated_recordings import (
    CALIBRATION_DURATION,
    EFFECTS,
    JUDGED_AFTER,
    SNAPSHOTS,
    Session,
    session,
    sessions,
)
from simulation_study.robustness.conditions import NO_MISMATCH, Condition
from simulation_study.robustness.estimation import fingerprint
from simulation_study.robustness.summary import LARGE_ERROR, WIDTH
from simulation_study.study_folder import StudyError, settle

RIG_FILE, SUBJECT_FILE, FAILURE_FILE = "rig.yaml", "subject.yaml", "failure.txt"
TABLE, RESULTS = "calibrated.md", "estimates"
UNCALIBRATED, WITH_RIG, WITH_BOTH = "none", "rig", "rig and session"
GAINS = {"K": "K[N.m/rad]", "G": "G[N.m.s/rad]"}
RESAMPLES = 2000
"""The recordings are resampled so often for the interval of a median."""


def calibrated(made: Session, folder: Path) -> tuple[RigFile | None, Model | None, str]:
    """Return the rig's file, the subject's model and what failed; they are kept in the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    failure = folder / FAILURE_FILE
    if not (folder / RIG_FILE).exists() and not failure.exists():
        try:
            made.rig().save(folder / RIG_FILE)
        except CalibrationError as error:
            failure.write_text(f"rig: {error}")
    rig = RigFile.load(folder / RIG_FILE) if (folder / RIG_FILE).exists() else None
    subject = folder / SUBJECT_FILE
    if not subject.exists() and not failure.exists():
        try:
            part = made.part(False)
            found = calibrate_session(part, folder, rig)
            require_gain(found, part, rig)
            found.model.save(subject)
        except CalibrationError as error:
            failure.write_text(f"session: {error}")
    return (
        rig,
        Model.load(subject) if subject.exists() else None,
        failure.read_text() if failure.exists() else "",
    )


def carry_out(condition: Condition, out: Path) -> dict[str, Any]:
    """Calibrate and estimate one recording; the result goes into JSON."""
    made = session(condition, out / "recordings")
    rig, subject, failure = calibrated(made, out / "files" / condition.name)
    knowledge: dict[str, KnownPhysics | None] = {UNCALIBRATED: None}
    knowledge[WITH_RIG] = KnownPhysics(rig) if rig is not None else None
    try:
        knowledge[WITH_BOTH] = KnownPhysics(rig, subject)
    except ModelError as error:
        knowledge[WITH_BOTH], failure = knowledge[WITH_RIG], f"estimator: {error}"
    part = made.part(True)
    terms = [] if subject is None else [e.term.name for e in subject.entries]
    return {
        "effect": condition.effect,
        "strength": condition.strength,
        "servo": condition.servo,
        "truth": list(made.truth),
        "momentary": made.momentary.tolist(),
        "failure": failure,
        "terms": terms,
        "estimates": {name: _online(part, known) for name, known in knowledge.items()},
    }


def _online(part: Recording, known: KnownPhysics | None) -> dict[str, Any]:
    """Estimate a part online; median of K and G, and snapshots of them, their errors and doubt."""
    rows = estimate_signal(
        part.time,
        part.position,
        part.velocity,
        part.torque,
        reference=part.reference,
        known=known,
    ).valid
    rows = rows[rows[:, 0] > JUDGED_AFTER]
    if not len(rows):
        return {"value": [float("nan")] * 2, "snapshots": []}
    columns = [ESTIMATE_COLUMNS.index(name) for name in GAINS.values()]
    errors = [ESTIMATE_COLUMNS.index(f"se_{name}") for name in GAINS.values()]
    doubt = ESTIMATE_COLUMNS.index("doubt[1]")
    kept = [min(int(np.searchsorted(rows[:, 0], t - 0.1)), len(rows) - 1) for t in SNAPSHOTS]
    return {
        "value": np.median(rows[:, columns], axis=0).tolist(),
        "snapshots": [rows[k, [*columns, *errors, doubt]].tolist() for k in kept],
    }


def study(out: Path, count: int, seed: int, effects: Sequence[str] = EFFECTS) -> str:
    """Run the study of some effects, or go on with it, and write its table.

    Raises
    ------
    StudyError
        Another study, or something else, is in `out`.
    """
    settle(out, {"study": "calibrated", "seed": seed, "effects": list(effects)})
    kept = out / f"{RESULTS}_{fingerprint()}"
    kept.mkdir(exist_ok=True)
    results = []
    for number, condition in enumerate(sessions(count, seed, effects), start=1):
        file = kept / f"{condition.name}.json"
        if not file.exists():
            print(f"{number} of {count}: {condition.name}", flush=True)
            file.write_text(json.dumps(carry_out(condition, out)))
        results.append(json.loads(file.read_text()))
    command = f".venv/bin/python -m simulation_study.calibrated_study --recordings {count} "
    command += f"--seed {seed} "
    if tuple(effects) != EFFECTS:
        command += "".join(f"--effect {name} " for name in effects)
    text = report(results, command + "--out FOLDER")
    (out / TABLE).write_text(text)
    return text


def report(results: list[dict[str, Any]], command: str) -> str:
    """Return the tables in Markdown."""
    lines = [
        "# Rig and session calibrated",
        "",
        f"Written by `{command}`: {len(results)} recordings of the independent rig, "
        f"{CALIBRATION_DURATION:g} s calibrate the session, {CALIBRATION_DURATION:g} s behind them "
        "are estimated online. Absolute error in % of the truth: median (90 % of the recordings "
        "within; largest). Covered: truth over the memory within 1.96 stated standard errors, % of "
        "snapshots. "
        "Flagged: of the snapshots with an error above 15 % (K) or 25 % (G) those with a doubt of "
        "0.5 or more.",
        "",
        "| calibrated | recordings | K | G | covered K, G | doubtful | flagged |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    nulls = [r for r in results if r["effect"] == NO_MISMATCH]
    effects = [r for r in results if r["effect"] != NO_MISMATCH]
    for name in (UNCALIBRATED, WITH_RIG, WITH_BOTH):
        for label, chosen in (("no mismatch", nulls), ("one effect", effects), ("all", results)):
            if chosen:
                lines.append(f"| {name} | {label} ({len(chosen)}) | {_row(chosen, name)} |")
    lines += ["", *_intervals(results)]
    lines += ["", "Each recording: error of K and G [%] without, with the rig's, with both files."]
    lines += ["", "| effect | servo | K | G | terms of the session beside the core |"]
    lines += ["| --- | --- | --- | --- | --- |"]
    for result in sorted(results, key=lambda r: str(r["effect"])):
        lines.append(_case(result))
    return "\n".join(lines) + "\n"


def _intervals(results: list[dict[str, Any]]) -> list[str]:
    """Return the table of all recordings with 95 % intervals."""
    lines = [
        "All recordings with 95 % intervals: median error of K and G [%], from resampled "
        "recordings; share of recordings [%] in which the truth lies within 1.96 standard errors "
        "at every snapshot, from the binomial distribution.",
        "",
        "| calibrated | K | G | covered K | covered G |",
        "| --- | --- | --- | --- | --- |",
    ]
    random = np.random.default_rng(0)
    chosen = random.integers(len(results), size=(RESAMPLES, len(results)))
    for name in (UNCALIBRATED, WITH_RIG, WITH_BOTH):
        sizes = np.abs([signed_errors(r, name) for r in results])
        medians = np.median(sizes[chosen], axis=1)
        cells = [
            f"{np.median(sizes[:, k]):.1f} [{low:.1f}, {high:.1f}]"
            for k, (low, high) in enumerate(np.quantile(medians, [0.025, 0.975], axis=0).T)
        ]
        for k in range(2):
            held = [
                all(off[k] <= WIDTH * errors[k] for off, _, errors, _ in snapshots)
                for r in results
                if (snapshots := _snapshots(r, name))
            ]
            if not held:
                cells.append("-")
                continue
            interval = stats.binomtest(sum(held), len(held)).proportion_ci(method="exact")
            share, low, high = (100.0 * x for x in (np.mean(held), interval.low, interval.high))
            cells.append(f"{share:.0f} [{low:.0f}, {high:.0f}] of {len(held)}")
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return lines


def signed_errors(result: dict[str, Any], name: str) -> np.ndarray:
    """Return the errors of K and G [%], shape (2,); 100 % where nothing was estimated."""
    found = np.array(result["estimates"][name]["value"], dtype=float)
    return np.asarray(np.nan_to_num(100.0 * (found / np.array(result["truth"]) - 1.0), nan=100.0))


def _snapshots(
    result: dict[str, Any], name: str
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, float]]:
    """Return how far K and G are off in each snapshot, the truth over its memory, the standard
    errors, and the doubt.
    """
    found = result["estimates"][name]["snapshots"]
    return [
        (np.abs(np.subtract(row[:2], truth)), np.array(truth), np.array(row[2:4]), float(row[4]))
        for row, truth in zip(found, result["momentary"], strict=bool(found))
    ]


def _row(chosen: Iterable[dict[str, Any]], name: str) -> str:
    results = list(chosen)
    sizes = np.abs([signed_errors(r, name) for r in results])
    cells = [f"{np.median(s):.1f} ({np.quantile(s, 0.9):.0f}; {s.max():.0f})" for s in sizes.T]
    covered: list[tuple[bool, bool]] = []
    doubts, wrong = [], []
    for r in results:
        for off, truth, errors, doubt in _snapshots(r, name):
            covered.append((off[0] <= WIDTH * errors[0], off[1] <= WIDTH * errors[1]))
            share = 100.0 * off / np.abs(truth)
            wrong.append(share[0] > LARGE_ERROR["K"] or share[1] > LARGE_ERROR["G"])
            doubts.append(doubt >= DOUBT_THRESHOLD)
    held = 100.0 * np.mean(covered, axis=0) if covered else [np.nan, np.nan]
    flagged = [d for d, w in zip(doubts, wrong, strict=True) if w]
    said = f"{100.0 * np.mean(flagged):.0f} % of {len(flagged)}" if flagged else "-"
    return (
        f"{cells[0]} | {cells[1]} | {held[0]:.0f}, {held[1]:.0f} | {100.0 * np.mean(doubts):.0f} | "
        f"{said}"
    )


def _case(result: dict[str, Any]) -> str:
    K, G = (
        " / ".join(f"{signed_errors(result, name)[i]:+.0f}" for name in result["estimates"])
        for i in range(2)
    )
    core = ("inertia", "viscosity", "stiffness", "reflex")
    terms = ", ".join(t for t in result["terms"] if t not in core) or result["failure"] or "none"
    label = f"{result['effect']} {result['strength']}".strip()
    return f"| {label} | {result['servo']} | {K} | {G} | {terms} |"


def main() -> None:
    """Run the study from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--recordings", type=int, default=30)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument(
        "--effect",
        action="append",
        choices=sorted(MAGNITUDES),
        help="of the rig, again for a further one; without: those that stay as they are",
    )
    options = parser.parse_args()
    try:
        effects = options.effect or EFFECTS
        print(study(options.out, options.recordings, options.seed, effects))
    except StudyError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
