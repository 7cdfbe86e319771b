"""The trials behind the paper's table II (van 't Veld et al. 2018, section III-A)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simulation_study.trial import DURATION, Ankle, Course, Trial

COMBINATIONS = {
    "OO": ("O", "O"),
    "OC": ("O", "C"),
    "CO": ("C", "O"),
    "CC": ("C", "C"),
    "CEO": ("CE", "O"),
    "CECE": ("CE", "CE"),
}
"""Rig (signal and model) and algorithm of each column of table II; table I of the paper."""
K_RANGE, G_RANGE = (0.0, 200.0), (0.0, 20.0)
"""[N.m/rad], [N.m.s/rad]: of the random conditions."""
RANDOM_CONDITIONS = ("random_K", "random_G", "random_K_and_G")
CONDITIONS = (*RANDOM_CONDITIONS, "fixed", "jump")


@dataclass(frozen=True)
class Size:
    """Describes how much is simulated.

    Attributes
    ----------
    runs
        Of each random condition; 100 in the paper.
    seeds
        Of the fixed and the jump run; one in the paper, whose spread is therefore not known.
    seconds
        Of each run.
    """

    runs: int = 100
    seeds: int = 20
    seconds: float = DURATION


FULL_SIZE, QUICK_SIZE = Size(), Size(runs=8, seeds=5)


def table2_trials(size: Size, seed: int) -> list[Trial]:
    """Return all trials: every recording is read by both algorithms of its rig.

    K, G, perturbation and noise of a run are the same for all rigs, so that columns differ by rig
    and algorithm alone.
    """
    rigs = {
        rig: tuple(algorithm for other, algorithm in COMBINATIONS.values() if other == rig)
        for rig, _ in COMBINATIONS.values()
    }
    trials = []
    for number, condition in enumerate(CONDITIONS):
        random = np.random.default_rng([seed, number])
        for run in range(size.runs if condition in RANDOM_CONDITIONS else size.seeds):
            K, G = random.uniform(*K_RANGE), random.uniform(*G_RANGE)
            own_seed = int(random.integers(2**31 - 1))
            ankle = Ankle(
                K=K if condition in ("random_K", "random_K_and_G") else Ankle.K,
                G=G if condition in ("random_G", "random_K_and_G") else Ankle.G,
            )
            course = Course("jump") if condition == "jump" else None
            trials += [
                Trial(
                    f"{condition}_{run:03d}_{rig}",
                    rig,
                    estimators,
                    own_seed,
                    ankle,
                    course,
                    size.seconds,
                )
                for rig, estimators in rigs.items()
            ]
    return trials
