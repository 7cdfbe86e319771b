"""Recordings of the independent rig with their truth, kept so that only new estimators compute."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from blind_rig.impedance import true_impedance
from blind_rig.trial import record, run
from simulation_study.estimates import IGNORED_DURATION, SNAPSHOT
from simulation_study.robustness.conditions import JUMP, Condition, blind_trial

MEMORIES = (10.0, 18.0, 0.0)
"""An estimate stands for so many seconds before it: one of the default estimator, and one of the
paper's algorithm, whose averages of K, B and I are so long (11 s for G). An offline method, the
last one, stands for just what it is given.
"""
SINGLE_ESTIMATES = 2
"""The first so many of `MEMORIES` belong to methods that state single estimates."""


@dataclass(frozen=True)
class Recorded:
    """Holds a recording and what was true in it.

    Attributes
    ----------
    rate
        [Hz].
    position, velocity, torque, reference
        [rad], [rad/s], [N.m], commanded angle [rad]; shape (n,).
    truth
        K [N.m/rad] and G [N.m.s/rad] of the joint in the stretch that is judged, earlier by half of
        each of `MEMORIES`; after a jump: behind it; shape (memories, 2).
    before
        K and G before a jump; those of the first memory without one.
    momentary
        K and G of the joint over the memory before each of `snapshot_times`, of `SINGLE_ESTIMATES`,
        shape (snapshots, 2, 2).
    """

    rate: float
    position: np.ndarray
    velocity: np.ndarray
    torque: np.ndarray
    reference: np.ndarray
    truth: np.ndarray
    before: tuple[float, float]
    momentary: np.ndarray

    @property
    def time(self) -> np.ndarray:
        """Return the sample times [s], the first 0, shape (n,)."""
        return np.arange(len(self.position)) / self.rate


def first_judged(condition: Condition) -> float:
    """Return the beginning of the stretch that is judged [s]."""
    return min(IGNORED_DURATION, 0.5 * condition.seconds)


def snapshot_times(condition: Condition) -> np.ndarray:
    """Return the times at which single estimates are judged [s]; none in a run with a jump."""
    if condition.effect == JUMP:
        return np.empty(0)
    return np.arange(first_judged(condition) + SNAPSHOT, condition.seconds + 1e-6, SNAPSHOT)


def recording(condition: Condition, folder: Path) -> Recorded:
    """Return the recording of a condition, simulated where the folder does not hold it yet.

    Parameters
    ----------
    condition
        The condition to simulate.
    folder
        Keeps one ``NAME.npz`` for each recording.

    Raises
    ------
    FloatingPointError
        The simulation diverged.
    """
    file = folder / f"{condition.name}.npz"
    if not file.exists():
        _write(file, _simulate(condition))
    with np.load(file) as kept:
        rate, *before = json.loads(str(kept["numbers"]))
        position, velocity, torque, reference = (
            kept[key].astype(float) for key in ("position", "velocity", "torque", "reference")
        )
        truth, momentary = kept["truth"], kept["momentary"]
    return Recorded(
        rate, position, velocity, torque, reference, truth, (before[0], before[1]), momentary
    )


def _simulate(condition: Condition) -> Recorded:
    trial = blind_trial(condition)
    done = run(trial)
    samples = record(trial, done)
    if condition.effect == JUMP:
        at = condition.jump_time
        spans = [(at, condition.seconds)] * len(MEMORIES)
        before = true_impedance(trial, done, 0.0, at)
    else:
        lags = [0.5 * memory for memory in MEMORIES]
        spans = [(first_judged(condition) - lag, condition.seconds - lag) for lag in lags]
        before = true_impedance(trial, done, *spans[0])
    truth = [true_impedance(trial, done, *span) for span in spans]
    times = snapshot_times(condition)
    momentary = [
        [true_impedance(trial, done, t - memory, t) for memory in MEMORIES[:SINGLE_ESTIMATES]]
        for t in times
    ]
    return Recorded(
        trial.rate,
        samples.position,
        samples.velocity,
        samples.torque,
        samples.reference[:, 0],
        np.array([[one.K, one.G] for one in truth]),
        (before.K, before.G),
        np.array([[[one.K, one.G] for one in each] for each in momentary]).reshape(
            len(times), SINGLE_ESTIMATES, 2
        ),
    )


def _write(file: Path, made: Recorded) -> None:
    """Write single precision: its rounding lies a thousand times below the sensors' noise."""
    file.parent.mkdir(parents=True, exist_ok=True)
    unfinished = file.with_suffix(f".{os.getpid()}.part")
    with unfinished.open("wb") as stream:
        np.savez(
            stream,
            numbers=json.dumps([made.rate, *made.before]),
            truth=made.truth,
            position=made.position.astype(np.float32),
            velocity=made.velocity.astype(np.float32),
            torque=made.torque.astype(np.float32),
            reference=made.reference.astype(np.float32),
            momentary=made.momentary,
        )
    os.replace(unfinished, file)
