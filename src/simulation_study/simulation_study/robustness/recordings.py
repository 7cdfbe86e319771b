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

MEAN_ESTIMATE_LAG = 10.0
"""An estimate lies so far behind [s] on average: half of the longest memory. The truth is that of
the samples which the estimates stand for.
"""
MEMORIES = (10.0, 18.0)
"""A single estimate stands for so many seconds before it: those of the default estimator, and the
averaging of the paper's algorithm for K, B and I (11 s for G).
"""


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
        K [N.m/rad] and G [N.m.s/rad] of the stretch that is judged; after a jump: behind it.
    before
        The same before a jump; equal to `truth` without one.
    momentary
        K and G of the joint over each of `MEMORIES` before each of `snapshot_times`, shape
        (snapshots, memories, 2).
    """

    rate: float
    position: np.ndarray
    velocity: np.ndarray
    torque: np.ndarray
    reference: np.ndarray
    truth: tuple[float, float]
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
        rate, K, G, K_before, G_before = json.loads(str(kept["numbers"]))
        position, velocity, torque, reference = (
            kept[key].astype(float) for key in ("position", "velocity", "torque", "reference")
        )
        momentary = kept["momentary"]
    return Recorded(
        rate, position, velocity, torque, reference, (K, G), (K_before, G_before), momentary
    )


def _simulate(condition: Condition) -> Recorded:
    trial = blind_trial(condition)
    done = run(trial)
    samples = record(trial, done)
    if condition.effect == JUMP:
        at = condition.jump_time
        spans = ((at, condition.seconds), (0.0, at))
    else:
        first = first_judged(condition)
        spans = ((first - MEAN_ESTIMATE_LAG, condition.seconds - MEAN_ESTIMATE_LAG),) * 2
    after, before = (true_impedance(trial, done, *span) for span in spans)
    times = snapshot_times(condition)
    over = [[true_impedance(trial, done, t - memory, t) for memory in MEMORIES] for t in times]
    momentary = [[[one.K, one.G] for one in memories] for memories in over]
    return Recorded(
        trial.rate,
        samples.position,
        samples.velocity,
        samples.torque,
        samples.reference[:, 0],
        (after.K, after.G),
        (before.K, before.G),
        np.reshape(momentary, (len(times), len(MEMORIES), 2)),
    )


def _write(file: Path, made: Recorded) -> None:
    """Write single precision: its rounding lies a thousand times below the sensors' noise."""
    file.parent.mkdir(parents=True, exist_ok=True)
    unfinished = file.with_suffix(f".{os.getpid()}.part")
    with unfinished.open("wb") as stream:
        np.savez(
            stream,
            numbers=json.dumps([made.rate, *made.truth, *made.before]),
            position=made.position.astype(np.float32),
            velocity=made.velocity.astype(np.float32),
            torque=made.torque.astype(np.float32),
            reference=made.reference.astype(np.float32),
            momentary=made.momentary,
        )
    os.replace(unfinished, file)
