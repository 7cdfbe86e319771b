"""The estimators against each other: speed, variability, bias, voluntary torque, tracking, standard
errors.

    python -m simulation_study.comparison --out comparison_study

All trials are of the rig CE (2048 Hz, the paper's noise). Their seeds come from another stream than
those of table II. What the columns mean is said in ``docs/estimators.md``.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
from rich.console import Console

from simulation_study.comparison_report import write_comparison
from simulation_study.estimates import CUTOFF_FACTORS, MEMORIES, carry_out
from simulation_study.study import run_study
from simulation_study.trial import Ankle, Course, Trial

STREAM = 47
"""Labels the seeds of this study, so that they are not those of table II, of the tests, or of any
tuning.
"""
VOLUNTARY_TORQUES = {
    "none": (0.0, 0.3),
    "0.5 N.m below 0.3 Hz": (0.5, 0.3),
    "1 N.m below 1 Hz": (1.0, 1.0),
}
"""Root mean square [N.m] and cut-off [Hz] of the subject's own torque."""
COMPARED_ESTIMATORS = ("CE", "CE all", "simultaneous")
PICTURED_ESTIMATORS = (
    *COMPARED_ESTIMATORS,
    *(f"{label} x{factor:g}" for factor in CUTOFF_FACTORS for label in ("CE", "CE all")),
    *(f"simultaneous {memory:g} s" for memory in MEMORIES),
    *(f"simultaneous {memory:g} s, fixed" for memory in MEMORIES),
)
"""Estimators of the picture of speed against variability."""
REFLEXES = tuple(product((15.0, 21.0, 30.0), (0.6, 0.8, 1.0), (0.035, 0.045, 0.055)))
"""omega [rad/s], z [1], delay [s]"""
RAMPS = (2.0, 10.0, 30.0)
"""[s] for K from 50 to 150 and G from 5 to 15"""
FREQUENCIES = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)
"""[Hz] of K 100 ± 30 and G 10 ± 3."""
FULL_SIZE, QUICK_SIZE = (
    {"jump": 10, "fixed": 10, "reflex": 3, "moving": 3, "calibration": 200},
    {
        "jump": 2,
        "fixed": 2,
        "reflex": 1,
        "moving": 1,
        "calibration": 10,
    },
)
"""Seeds of each part."""
CALIBRATION_SECONDS = 90.0
"""Two snapshots of full memory, 30 s apart."""


def comparison_trials(seeds: dict[str, int], seed: int) -> list[Trial]:
    """Return all trials; the name's part before the first underscore is the part of the study."""
    random = np.random.default_rng([STREAM, seed])

    def fresh() -> int:
        return int(random.integers(2**31 - 1))

    # The seeds are drawn in this order.
    return [
        *_voluntary_torque_trials(seeds, fresh),
        *_reflex_trials(seeds["reflex"], fresh),
        *_moving_trials(seeds["moving"], fresh),
        *_calibration_trials(seeds["calibration"], fresh),
    ]


def _voluntary_torque_trials(seeds: dict[str, int], fresh: Callable[[], int]) -> list[Trial]:
    """Return trials with a jump of K and G, and without one, with each voluntary torque."""
    return [
        Trial(
            f"{part}_{label}_{run}",
            "CE",
            PICTURED_ESTIMATORS,
            fresh(),
            Ankle(voluntary_rms=rms, voluntary_cutoff=cutoff),
            course,
            160.0 if course else 180.0,
        )
        for (label, (rms, cutoff)), (part, course) in product(
            VOLUNTARY_TORQUES.items(), (("jump", Course("jump")), ("fixed", None))
        )
        for run in range(seeds[part])
    ]


def _reflex_trials(runs: int, fresh: Callable[[], int]) -> list[Trial]:
    return [
        Trial(
            f"reflex_{omega:g}_{z:g}_{delay:g}_{run}",
            "CE",
            COMPARED_ESTIMATORS,
            fresh(),
            Ankle(omega=omega, z=z, delay=delay),
            None,
            120.0,
        )
        for (omega, z, delay), run in product(REFLEXES, range(runs))
    ]


def _moving_trials(runs: int, fresh: Callable[[], int]) -> list[Trial]:
    """Return trials in which K and G change evenly, then those in which they swing."""
    wave = Course("sinusoid", K=(70.0, 130.0), G=(7.0, 13.0))
    ramps = [
        (f"ramp_{over:g}_{run}", Course("ramp", at=60.0, over=over), 120.0)
        for over, run in product(RAMPS, range(runs))
    ]
    waves = [
        (
            f"sinusoid_{frequency:g}_{run}",
            replace(wave, frequency=frequency),
            30.0 + max(90.0, 1.0 / frequency),
        )
        for frequency, run in product(FREQUENCIES, range(runs))
    ]
    return [
        Trial(name, "CE", COMPARED_ESTIMATORS, fresh(), Ankle(), course, seconds)
        for name, course, seconds in (*ramps, *waves)
    ]


def _calibration_trials(runs: int, fresh: Callable[[], int]) -> list[Trial]:
    return [
        Trial(
            f"calibration_{run}",
            "CE",
            ("CE all", "simultaneous"),
            fresh(),
            Ankle(),
            None,
            CALIBRATION_SECONDS,
        )
        for run in range(runs)
    ]


def main() -> None:
    """Run the study or go on with it; write the tables and the picture into its folder."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--out", type=Path, default=Path("comparison_study"))
    options.add_argument("--seed", type=int, default=1)
    options.add_argument(
        "--quick",
        action="store_true",
        help="2 seeds instead of 10, 10 instead of 200 for the standard errors",
    )
    options.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    options.add_argument("--scheduler", help="address of a running Dask scheduler")
    given = options.parse_args()
    seeds = QUICK_SIZE if given.quick else FULL_SIZE
    asked = {"study": "comparison", "seed": given.seed, "seeds": seeds}
    trials = comparison_trials(seeds, given.seed)
    results = run_study(
        trials, asked, given.out, carry_out, given.workers, given.scheduler, Console(stderr=True)
    )
    print(write_comparison(results, given.out))


if __name__ == "__main__":
    main()
