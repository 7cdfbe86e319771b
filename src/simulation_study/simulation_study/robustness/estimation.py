"""Estimates of a recording are reduced to the numbers that the study reports."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import impedance_estimator
from impedance_estimator.estimator import ESTIMATE_COLUMNS
from impedance_estimator.offline.parallel_cascade import parallel_cascade
from impedance_estimator.offline.recorded_estimates import estimate_signal
from impedance_estimator.settings import EstimatorSettings, Settings
from impedance_estimator.simultaneous.settings import SimultaneousSettings
from simulation_study.estimates import ARRIVAL_DURATION, IGNORED_DURATION
from simulation_study.robustness.conditions import JUMP, Condition
from simulation_study.robustness.recordings import (
    Recorded,
    first_judged,
    recording,
    snapshot_times,
)

ONLINE: dict[str, tuple[str, EstimatorSettings]] = {
    "simultaneous": ("simultaneous", SimultaneousSettings()),
    "CE all": ("CE", Settings(highpass="all")),
    "CE": ("CE", Settings()),
}
"""Algorithm and settings of the online estimators by the name that the tables use."""
OFFLINE = "parallel cascade"
"""Over the whole judged stretch; without standard errors."""
MEMORY_OF = {"simultaneous": 0, "CE all": 1, "CE": 1, OFFLINE: 2}
"""Which of `recordings.MEMORIES` an estimate stands for."""
ARRIVED_OF_JUMP, ARRIVED_OF_VALUE = 0.1, 0.05
"""Tolerance about the new value: the larger of these shares of the jump and of the value. A tenth
of a small jump lies inside the scatter of any estimator.
"""


def fingerprint() -> str:
    """Return the hash of the estimators' code: results of other code are not taken for those of
    this one.
    """
    digest = hashlib.sha256()
    package = Path(impedance_estimator.__file__).parent
    for file in (*sorted(package.rglob("*.py")), Path(__file__)):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def estimate_condition(folder: Path) -> Callable[[Condition], dict[str, Any]]:
    """Make one condition's estimates in a worker; recordings are kept in `folder`."""
    return _Estimation(folder)


class _Estimation:
    """Estimates one condition; a class and no closure, because Dask pickles it."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __call__(self, condition: Condition) -> dict[str, Any]:
        made = recording(condition, self._folder)
        found = {
            name: summarise(online(name, made), made, condition, MEMORY_OF[name]) for name in ONLINE
        }
        if condition.effect != JUMP:
            found[OFFLINE] = _offline(made, condition)
        for name, estimate in found.items():
            estimate["truth"] = made.truth[MEMORY_OF[name]].tolist()
        return {
            "condition": condition.as_content(),
            "before": list(made.before),
            "estimates": found,
        }


def online(name: str, made: Recorded) -> np.ndarray:
    """Return all estimates of an online estimator, columns `ESTIMATE_COLUMNS`."""
    algorithm, settings = ONLINE[name]
    return estimate_signal(
        made.time, made.position, made.velocity, made.torque, algorithm, settings, made.reference
    ).rows


def _column(rows: np.ndarray, name: str) -> np.ndarray:
    return rows[:, ESTIMATE_COLUMNS.index(name)]


def _offline(made: Recorded, condition: Condition) -> dict[str, Any]:
    first = round(first_judged(condition) * made.rate)
    try:
        cascade = parallel_cascade(
            made.rate, made.position[first:], made.torque[first:], made.velocity[first:]
        )
        value = [cascade.stiffness, cascade.gain]
    except (ValueError, np.linalg.LinAlgError):
        value = [float("nan"), float("nan")]
    return {"value": value, "spread": None, "snapshots": None, "invalid": 0.0}


def summarise(
    rows: np.ndarray, made: Recorded, condition: Condition, memory: int
) -> dict[str, Any]:
    """Return numbers of one online estimator on one recording.

    Parameters
    ----------
    rows
        Of all estimates, columns `ESTIMATE_COLUMNS`.
    made, condition
        What was recorded.
    memory
        Which of `recordings.MEMORIES` a single estimate stands for.

    Returns
    -------
    dict[str, Any]
        ``value`` and ``spread``: median and standard deviation of K and G over the judged stretch;
        ``invalid``: share of the time without a valid estimate; ``snapshots``: K, G, their standard
        errors, doubt, and the true K and G over its memory at each of `snapshot_times`; after a
        jump ``arrival`` of K and G [s], None where it does not arrive.
    """
    rows = rows[_column(rows, "t[s]") > first_judged(condition)]
    valid = rows[_column(rows, "valid[1]") > 0.0]
    out: dict[str, Any] = {"invalid": 1.0 - len(valid) / max(len(rows), 1)}
    if not len(valid):
        nothing = [float("nan"), float("nan")]
        return out | {"value": nothing, "spread": nothing, "snapshots": [], "arrival": [None, None]}
    time = _column(valid, "t[s]")
    values = np.column_stack([_column(valid, "K[N.m/rad]"), _column(valid, "G[N.m.s/rad]")])
    if condition.effect == JUMP:
        out["arrival"] = [
            arrival(time, values[:, i], made.before[i], made.truth[memory, i], condition.jump_time)
            if condition.jump[i] != 1.0
            else None
            for i in range(2)
        ]
        late = time > condition.jump_time + IGNORED_DURATION / 2.0
        out["value"] = np.median(values[late], axis=0).tolist() if late.any() else [np.nan, np.nan]
        out["spread"] = values[late].std(axis=0).tolist() if late.any() else [np.nan, np.nan]
        out["snapshots"] = []
        return out
    errors = np.column_stack([_column(valid, "se_K[N.m/rad]"), _column(valid, "se_G[N.m.s/rad]")])
    doubt = _column(valid, "doubt[1]") if "doubt[1]" in ESTIMATE_COLUMNS else np.zeros(len(valid))
    kept = np.searchsorted(time, snapshot_times(condition) - 0.1)
    kept = np.minimum(kept, len(time) - 1)
    out["value"] = np.median(values, axis=0).tolist()
    out["spread"] = values.std(axis=0).tolist()
    out["snapshots"] = [
        [*values[k], *errors[k], float(doubt[k]), *true[memory]]
        for k, true in zip(kept, made.momentary, strict=True)
    ]
    return out


def arrival(
    time: np.ndarray, values: np.ndarray, before: float, after: float, at: float
) -> float | None:
    """Return the time [s] from a jump until the values stay near the new level; None: never.

    They must stay there for `ARRIVAL_DURATION`.

    Parameters
    ----------
    time
        [s], ascending, shape (n,).
    values
        Values of the estimate, shape (n,).
    before, after
        True values on both sides of the jump.
    at
        When it is [s].
    """
    tolerance = max(ARRIVED_OF_JUMP * abs(after - before), ARRIVED_OF_VALUE * abs(after))
    near = np.abs(values - after) <= tolerance
    for k in np.flatnonzero(near & (time >= at)):
        if near[k : np.searchsorted(time, time[k] + ARRIVAL_DURATION)].all():
            return float(time[k] - at)
    return None
