"""Bias of K and G against the stiffness of the servo: ``python -m simulation_study.servo_bias
--subjects 6 --seed 1 --out FOLDER``.

A servo that gives way lets torque which no movement causes (voluntary torque, tremor, a reflex that
varies from stretch to stretch) into the measured motion, and a regression on that motion is biased.
Every subject of the independent MuJoCo rig, without any mismatch, is recorded behind servos from
very soft to rigid, with the same perturbation and the same voluntary torque, and each recording is
estimated with the reference as instrument and without it. FOLDER keeps one file a recording, so
that an interrupted study goes on where it stopped, and receives ``servo_bias.md``.
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from blind_rig.impedance import true_impedance
from blind_rig.trial import record, run
from impedance_estimator.estimator import ESTIMATE_COLUMNS
from impedance_estimator.offline.recorded_estimates import estimate_signal
from simulation_study.robustness.conditions import (
    NO_MISMATCH,
    USUAL_VARIATION,
    VOLUNTARY_TORQUES,
    Condition,
    blind_trial,
)
from simulation_study.robustness.estimation import fingerprint
from simulation_study.study_folder import StudyError, settle

STREAM = 61
"""Labels the seeds of this study, so that they are not those of any other."""
STIFFNESSES = (1000.0, 1500.0, 2500.0, 5000.0, math.inf)
"""[N.m/rad] Of the servo against load. Real rigs show 2000 to 3000."""
DURATION = 90.0
"""[s] Of a recording: six memories of the estimator after it has settled."""
JUDGED_AFTER = 30.0
"""[s] Estimates of the first seconds are ignored, as in the robustness study."""
GAINS = ("K[N.m/rad]", "G[N.m.s/rad]")
TABLE, RESULTS = "servo_bias.md", "estimates"
INSTRUMENTS = ("with reference", "without reference")


def subjects(count: int, seed: int) -> list[Condition]:
    """Return one condition for each subject; kinds of voluntary torque follow each other.

    Parameters
    ----------
    count
        Number of subjects; those of a smaller count are the first ones of a larger one.
    seed
        Draws subjects, perturbations and voluntary torque.
    """
    random = np.random.default_rng([STREAM, seed])
    kinds = list(VOLUNTARY_TORQUES)
    return [
        Condition(
            f"{k:03d}",
            NO_MISMATCH,
            "",
            "stiff",
            kinds[k % len(kinds)],
            USUAL_VARIATION,
            (1.0, 1.0),
            int(random.integers(2**62)),
            DURATION,
        )
        for k in range(count)
    ]


def carry_out(condition: Condition, stiffness: float) -> dict[str, Any]:
    """Simulate and estimate one recording; the result goes into JSON.

    Parameters
    ----------
    condition
        The subject.
    stiffness
        Of the servo [N.m/rad]; infinite is rigid.
    """
    trial = blind_trial(condition)
    # The rig takes 0 for a servo that does not give way.
    servo = stiffness if math.isfinite(stiffness) else 0.0
    trial = trial._replace(setup=trial.setup.replaced({"rig.servo_k": servo}))
    done = run(trial)
    samples = record(trial, done)
    truth = true_impedance(trial, done, JUDGED_AFTER, condition.seconds)
    columns = [ESTIMATE_COLUMNS.index(name) for name in GAINS]
    found = {}
    for name in INSTRUMENTS:
        rows = estimate_signal(
            samples.time,
            samples.position,
            samples.velocity,
            samples.torque,
            reference=samples.reference[:, 0] if name == INSTRUMENTS[0] else None,
        ).valid
        found[name] = rows[rows[:, 0] > JUDGED_AFTER][:, columns].mean(axis=0).tolist()
    return {"truth": [truth.K, truth.G], "estimates": found}


def study(out: Path, count: int, seed: int) -> str:
    """Run the study, or go on with it, and write its table.

    Raises
    ------
    StudyError
        Another study, or something else, is in `out`.
    """
    settle(out, {"study": "servo bias", "seed": seed})
    kept = out / f"{RESULTS}_{fingerprint()}"
    kept.mkdir(exist_ok=True)
    results: dict[float, list[dict[str, Any]]] = {stiffness: [] for stiffness in STIFFNESSES}
    for condition in subjects(count, seed):
        for stiffness in STIFFNESSES:
            file = kept / f"{condition.name}_{stiffness:g}.json"
            if not file.exists():
                print(f"subject {condition.name} of {count}, {stiffness:g} N.m/rad", flush=True)
                file.write_text(json.dumps(carry_out(condition, stiffness)))
            results[stiffness].append(json.loads(file.read_text()))
    text = report(
        results,
        f".venv/bin/python -m simulation_study.servo_bias --subjects {count} --seed {seed} "
        "--out FOLDER",
    )
    (out / TABLE).write_text(text)
    return text


def report(results: dict[float, list[dict[str, Any]]], command: str) -> str:
    """Return the table in Markdown.

    Parameters
    ----------
    results
        Of `carry_out`, by stiffness of the servo [N.m/rad].
    command
        That made them.
    """
    count = len(next(iter(results.values())))
    lines = [
        "# Bias of K and G against the stiffness of the servo",
        "",
        f"Written by `{command}`: {count} subjects of the independent rig without a mismatch, each "
        f"behind every servo, {DURATION:g} s. Mean error of the estimates after "
        f"{JUDGED_AFTER:g} s in % of the truth ± its standard error over subjects.",
        "",
        "| servo [N.m/rad] | "
        + " | ".join(f"{gain}, {name}" for name in INSTRUMENTS for gain in ("K", "G"))
        + " |",
        "|" + " --- |" * (1 + 2 * len(INSTRUMENTS)),
    ]
    for stiffness, found in results.items():
        cells = []
        for name in INSTRUMENTS:
            errors = np.array([np.array(r["estimates"][name]) / r["truth"] - 1.0 for r in found])
            mean = 100.0 * errors.mean(axis=0)
            spread = errors.std(axis=0, ddof=1) if count > 1 else np.full(2, np.nan)
            cells += [
                f"{m:+.1f} ± {s:.1f}"
                for m, s in zip(mean, 100.0 * spread / math.sqrt(count), strict=True)
            ]
        label = f"{stiffness:g}" if math.isfinite(stiffness) else "rigid"
        lines.append(f"| {label} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run the study from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--subjects", type=int, default=6)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    try:
        print(study(options.out, options.subjects, options.seed))
    except StudyError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
