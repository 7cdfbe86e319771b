"""Changes are tried that would explain where table II is not reproduced.

They are a louder position, longer pulses, an actuator with more damping, another sampling rate,
other settings of the reflex fit.

    python -m simulation_study.sensitivity --out sensitivity_study

Fixed runs of the rig C with one thing changed at a time, read by algorithms O and C.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import numpy as np
from rich.console import Console

from simulation_study.estimates import GAINS, carry_out
from simulation_study.rigs import RIGS
from simulation_study.study import run_study
from simulation_study.trial import Trial

SEEDS = (1, 2)
CHANGED_RIGS = ("C", *(name for name in RIGS if name.startswith("C, ")))
READING_ALGORITHMS = (
    "O",
    "C",
    "C, ridge 1e-06",
    "C, ridge 1e-09",
    "C, ridge 0.1",
    "C, reflex average x2",
)


def sensitivity_trials() -> list[Trial]:
    """Return the rig as it is with all variants of algorithm C, and every changed rig with O
    and C.
    """
    return [
        Trial(
            f"{rig}_{seed}".replace(", ", "_").replace(" ", "_"),
            rig,
            READING_ALGORITHMS if rig == "C" else READING_ALGORITHMS[:2],
            seed,
        )
        for rig in CHANGED_RIGS
        for seed in SEEDS
    ]


def main() -> None:
    """Run or go on, and print means and variability (2 SD / mean) as Markdown."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--out", type=Path, default=Path("sensitivity_study"))
    options.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    given = options.parse_args()
    trials = sensitivity_trials()
    results = run_study(
        trials,
        {"study": "sensitivity"},
        given.out,
        carry_out,
        given.workers,
        console=Console(stderr=True),
    )
    print("| rig | algorithm | " + " | ".join(GAINS) + " | var K [%] | var G [%] |")
    print("|" + " --- |" * 8)
    for rig in CHANGED_RIGS:
        found = [
            result["estimates"] for result in results.values() if result["trial"]["rig"] == rig
        ]
        for algorithm in found[0]:
            mean = np.mean([estimates[algorithm]["mean"] for estimates in found], axis=0)
            spread = np.mean(
                [
                    np.divide(estimates[algorithm]["sd"], estimates[algorithm]["mean"])
                    for estimates in found
                ],
                axis=0,
            )
            cells = [
                f"{value:.{digits}f}" for value, digits in zip(mean, (1, 3, 4, 2), strict=True)
            ]
            print(
                f"| {rig} | {algorithm} | "
                + " | ".join(cells)
                + f" | {200.0 * spread[0]:.1f} | {200.0 * spread[3]:.1f} |"
            )


if __name__ == "__main__":
    main()
