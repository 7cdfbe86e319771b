"""A trial through the estimators, reduced to the numbers that the studies need."""

from __future__ import annotations

from typing import Any

import numpy as np

from ankle_physics.virtual_rig import Recording
from impedance_estimator.estimator import ESTIMATE_COLUMNS
from impedance_estimator.offline.recorded_estimates import estimate_signal
from impedance_estimator.settings import EstimatorSettings, Settings
from impedance_estimator.simultaneous.settings import SimultaneousSettings
from simulation_study.rigs import RIGS, record
from simulation_study.trial import INERTIA, VISCOSITY, Trial

IGNORED_DURATION = 30.0
"""Estimates of the first seconds [s] are ignored, longer than any memory: van 't Veld et al. 2018,
section III-A.
"""
SNAPSHOT = 30.0
"""Estimates are kept with their standard errors at this distance [s]: more than any memory, so that
they are independent.
"""
ARRIVAL_DURATION = 2.0
"""An estimate has arrived when it stays by its new value for so long [s]: three perturbations.
"""
GAINS = ("K", "B", "I", "G")
VALUES = [
    ESTIMATE_COLUMNS.index(name)
    for name in ("K[N.m/rad]", "B[N.m.s/rad]", "I[kg.m^2]", "G[N.m.s/rad]")
]
ERRORS = [
    ESTIMATE_COLUMNS.index(name)
    for name in ("se_K[N.m/rad]", "se_B[N.m.s/rad]", "se_I[kg.m^2]", "se_G[N.m.s/rad]")
]
VALID_COLUMN = ESTIMATE_COLUMNS.index("valid[1]")

CUTOFF_FACTORS = (2.0, 4.0)
"""The cut-offs of CE's averages are raised by these factors for the picture of speed against
variability.
"""
MEMORIES = (5.0, 10.0, 40.0)
"""[s] Memories of the simultaneous estimator for the same picture."""


def _estimators() -> dict[str, tuple[str, EstimatorSettings]]:
    found: dict[str, tuple[str, EstimatorSettings]] = {
        name: (name, Settings()) for name in ("O", "C", "CE")
    }
    found["CE all"] = ("CE", Settings(highpass="all"))
    for factor in CUTOFF_FACTORS:
        for label, highpass in (("CE", "torque"), ("CE all", "all")):
            found[f"{label} x{factor:g}"] = (
                "CE",
                Settings(
                    highpass=highpass,
                    intrinsic_average_cutoff=Settings.intrinsic_average_cutoff * factor,
                    reflex_average_cutoff=Settings.reflex_average_cutoff * factor,
                ),
            )
    for ridge in (1e-6, 1e-9, 0.1):
        found[f"C, ridge {ridge:g}"] = ("C", Settings(reflex_ridge=ridge))
    found["C, reflex average x2"] = (
        "C",
        Settings(reflex_average_cutoff=2.0 * Settings.reflex_average_cutoff),
    )
    found["simultaneous"] = ("simultaneous", SimultaneousSettings())
    for memory in MEMORIES:
        found[f"simultaneous {memory:g} s"] = ("simultaneous", SimultaneousSettings(memory=memory))
        found[f"simultaneous {memory:g} s, fixed"] = (
            "simultaneous",
            SimultaneousSettings(memory=memory, change_detection="off"),
        )
    return found


ESTIMATORS = _estimators()
"""Algorithm and settings by the name that trials use."""


def carry_out(trial: Trial) -> dict[str, Any]:
    """Simulate a trial, estimate, and summarise; everything in it can be written as JSON.

    Returns
    -------
    dict[str, Any]
        ``trial``, and ``estimates``: for each estimator what `summarise` says.
    """
    recording = record(trial)
    found = {
        name: summarise(
            estimate(name, recording, RIGS[trial.rig].measures_velocity), recording, trial
        )
        for name in trial.estimators
    }
    return {"trial": trial.as_content(), "estimates": found}


def estimate(name: str, recording: Recording, measured_velocity: bool) -> np.ndarray:
    """Return all estimates, shape (k, 12), columns `ESTIMATE_COLUMNS`."""
    algorithm, settings = ESTIMATORS[name]
    velocity = recording.velocity if measured_velocity else None
    return estimate_signal(
        recording.time, recording.position, velocity, recording.torque, algorithm, settings
    ).rows


def summarise(rows: np.ndarray, recording: Recording, trial: Trial) -> dict[str, Any]:
    """Return numbers of one estimator in one trial.

    Returns
    -------
    dict[str, Any]
        ``mean`` and ``sd`` of K, B, I, G after `IGNORED_DURATION` (within the trial), ``invalid``:
        share of the time without valid estimate; without a course ``snapshots``: estimates, their
        standard errors and the truth every `SNAPSHOT`; with a jump ``rise_time`` and ``arrival`` of
        K and G [s], NaN where there is none; with any course ``tracking_error``: root mean square
        error of K and G over half of their range [1].
    """
    rows = rows[rows[:, 0] > IGNORED_DURATION]
    after = rows[rows[:, VALID_COLUMN] > 0.0]
    out: dict[str, Any] = {
        "mean": after[:, VALUES].mean(axis=0).tolist(),
        "sd": after[:, VALUES].std(axis=0).tolist(),
        "invalid": 1.0 - len(after) / len(rows),
    }
    times = np.minimum(np.round(after[:, 0] * recording.rate).astype(int), len(recording.time) - 1)
    K, G = (
        recording.truth["stiffness.K[N.m/rad]"][times],
        recording.truth["reflex.G[N.m.s/rad]"][times],
    )
    if trial.course is None:
        # From the second snapshot on every estimator's memory is full.
        kept = np.searchsorted(
            after[:, 0], np.arange(2.0 * SNAPSHOT, trial.seconds + 1e-6, SNAPSHOT) - 1e-6
        )
        kept = np.minimum(kept, len(after) - 1)
        out["snapshots"] = {
            "value": after[kept][:, VALUES].tolist(),
            "error": after[kept][:, ERRORS].tolist(),
            "truth": [trial.ankle.K, VISCOSITY, INERTIA, trial.ankle.G],
        }
    else:
        course = trial.course
        error = [
            float(np.sqrt(np.mean((after[:, VALUES[index]] - true) ** 2)) / (0.5 * abs(high - low)))
            for index, true, (low, high) in ((0, K, course.K), (3, G, course.G))
        ]
        out["tracking_error"] = error
        if course.kind == "jump":
            moved = [(after[:, VALUES[i]], levels) for i, levels in ((0, course.K), (3, course.G))]
            out["rise_time"] = [
                rise_time(after[:, 0], values, levels, course.at) for values, levels in moved
            ]
            out["arrival"] = [
                arrival(after[:, 0], values, levels, course.at) for values, levels in moved
            ]
    return out


def rise_time(
    time: np.ndarray, values: np.ndarray, levels: tuple[float, float], at: float
) -> float:
    """Return the time [s] from the first crossing of 10 % to the first crossing of 90 % of a jump;
    NaN where one is never reached.

    van 't Veld et al. 2018, section III-A: levels of the modelled jump, not of the estimate's own
    steady state.

    Parameters
    ----------
    time
        [s], ascending, shape (n,).
    values
        Values of the estimate, shape (n,).
    levels
        Before and after the jump.
    at
        Time of the jump [s].
    """
    low, high = levels
    share = (values - low) / (high - low)
    after = time >= at
    begun, ended = after & (share >= 0.1), after & (share >= 0.9)
    if not ended.any():
        return float("nan")
    return float(time[np.argmax(ended)] - time[np.argmax(begun)])


def arrival(time: np.ndarray, values: np.ndarray, levels: tuple[float, float], at: float) -> float:
    """Return the time [s] from a jump until the values stay within 10 % of it about the new level
    for `ARRIVAL_DURATION`; NaN where they never do.

    Unlike the rise time it counts the delay before an estimate moves, and what it overshoots.

    Parameters
    ----------
    time
        [s], ascending, shape (n,).
    values
        Values of the estimate, shape (n,).
    levels
        Before and after the jump.
    at
        Time of the jump [s].
    """
    low, high = levels
    within = (np.abs(values - high) <= 0.1 * abs(high - low)) & (time >= at)
    for k in np.flatnonzero(within):
        if within[k : np.searchsorted(time, time[k] + ARRIVAL_DURATION)].all():
            return float(time[k] - at)
    return float("nan")
