"""Spread a study over the cores of this computer, or over a cluster of Dask.

    python examples/study_on_dask.py my_study
    python examples/study_on_dask.py my_study --scheduler tcp://head-node:8786

An interrupted study goes on where it stopped.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from simulation_study.study import run_study


@dataclass(frozen=True)
class Trial:
    """Holds one trial: a mass on a spring, with noise in the measured torque."""

    name: str
    seed: int


def carry_out(trial: Trial) -> dict[str, float]:
    """Estimate a stiffness of 100 N.m/rad from 1000 noisy samples."""
    random = np.random.default_rng(trial.seed)
    position = 0.02 * random.standard_normal(1000)
    torque = 100.0 * position + 0.2 * random.standard_normal(1000)
    return {"K[N.m/rad]": float(position @ torque / (position @ position))}


def main() -> None:
    """Read the command line, run the study, show the spread."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--scheduler", help="address of a running Dask scheduler")
    asked = parser.parse_args()
    trials = [Trial(f"trial_{seed}", seed) for seed in range(asked.trials)]
    question = {"trials": asked.trials}
    found = run_study(trials, question, asked.out, carry_out, 2, asked.scheduler)
    K = np.array([result["K[N.m/rad]"] for result in found.values()])
    print(f"{len(K)} trials: K = {K.mean():.2f} +- {K.std(ddof=1):.2f} N.m/rad")


if __name__ == "__main__":
    main()
