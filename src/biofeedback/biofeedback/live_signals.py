"""The signals received from the graph so far: newest estimate, the subject's torque, traces,
health.

Fed and read by different threads.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from biofeedback.graph_health import GraphHealth
from biofeedback.muscle_activity import MuscleActivity
from biofeedback.voluntary_torque import CUTOFF, VoluntaryTorque
from biofeedback.web.live_traces import MinMaxTraces

STALE_AFTER = 0.5
"""[s] Largest age of what is shown: older estimates or samples describe another moment than the one
the subject feels."""
RESPONSES_KEPT = 100
"""Largest number of EMG responses that wait to be read; they are read 30 times a second."""
WAITING, INVALID, STALE, GOOD = "waiting", "invalid", "stale", "valid"


@dataclass(frozen=True)
class Snapshot:
    """Holds the values of the signals at one moment.

    Attributes
    ----------
    K, G
        Newest valid estimates [N.m/rad], [N.m.s/rad]; NaN before the first.
    torque
        The subject's torque [N.m]; NaN before the first sample.
    estimate_time
        Of the newest estimate, valid or not [s, ROS time].
    age
        Of the newest estimate [s]; infinite before the first.
    quality
        Of the estimates: `WAITING`, `INVALID`, `STALE` or `GOOD`.
    torque_quality
        Of the torque: `WAITING`, `STALE` or `GOOD`.
    angle
        Of the plate, newest sample [rad]; NaN before the first.
    emg
        Activity of each muscle, see `MuscleActivity` [V]; empty before the first block.
    emg_quality
        Of the EMG: `WAITING`, `STALE` or `GOOD`.
    """

    K: float
    G: float
    torque: float
    estimate_time: float
    age: float
    quality: str
    torque_quality: str
    angle: float
    emg: Mapping[str, float]
    emg_quality: str = WAITING


class _Arrival:
    """Holds when a signal arrived last, and the time that its newest sample was taken."""

    def __init__(self) -> None:
        self._heard, self.time = -math.inf, math.nan

    def note(self, time: float, heard: float) -> None:
        self._heard, self.time = heard, time

    def age(self, now: float, heard_now: float) -> float:
        """Return the larger one of time since arrival and time since it was true: a reader that
        lags behind also gives old values.
        """
        return (
            max(heard_now - self._heard, now - self.time) if math.isfinite(self.time) else math.inf
        )


def _quality(age: float) -> str:
    return WAITING if age == math.inf else STALE if age > STALE_AFTER else GOOD


class LiveSignals:
    """Collects blocks of every topic that a page shows.

    Parameters
    ----------
    torque_cutoff
        Of the subject's torque [Hz].
    emg_names
        Channels of the EMG traces.
    """

    def __init__(self, torque_cutoff: float = CUTOFF, emg_names: Sequence[str] = ()) -> None:
        self._lock = threading.Lock()
        self._torque = VoluntaryTorque(torque_cutoff)
        self._K = self._G = self._angle = math.nan
        self._activity = MuscleActivity(tuple(emg_names))
        self._responses: deque[np.ndarray] = deque(maxlen=RESPONSES_KEPT)
        self._valid = False
        self._estimates, self._samples, self._emg = _Arrival(), _Arrival(), _Arrival()
        self.health = GraphHealth()
        self.traces = {
            "ankle": MinMaxTraces(("torque", "angle")),
            "estimate": MinMaxTraces(("K", "G")),
            "emg": MinMaxTraces(emg_names),
        }

    def feed_estimates(self, rows: np.ndarray, heard: float) -> None:
        """Process estimates, shape (n, 4): t [s], K, G, valid.

        `heard` is the monotonic time of their arrival [s].
        """
        with self._lock:
            for time, K, G, valid in rows.tolist():
                self._valid = valid == 1.0
                self._estimates.note(time, heard)
                if self._valid:
                    self._K, self._G = K, G
            shown = np.where(rows[:, 3:] == 1.0, rows[:, 1:3], np.nan)
            self.traces["estimate"].feed(rows[:, 0], shown)

    def feed_samples(self, samples: np.ndarray, rate: float, heard: float) -> None:
        """Process samples of the rig.

        Parameters
        ----------
        samples
            Shape (n, 4): t [s], position [rad], velocity [rad/s], torque [N.m].
        rate
            Sampling rate [Hz].
        heard
            Monotonic time of arrival [s].
        """
        if not len(samples):
            return
        with self._lock:
            self._samples.note(float(samples[-1, 0]), heard)
            self._angle = float(samples[-1, 1])
            self._torque.feed(samples[:, 1:], rate, self._K, self._G)
            self.traces["ankle"].feed(
                samples[:, 0], np.column_stack([samples[:, 3], np.degrees(samples[:, 1])])
            )

    def feed_emg(self, samples: np.ndarray, rate: float, heard: float) -> None:
        """Process EMG, shape (n, 1 + channels): t [s], then [V]; it is shown in microvolts.

        `rate` is the sampling rate [Hz], `heard` the monotonic time of arrival [s].
        """
        if not len(samples):
            return
        with self._lock:
            self._emg.note(float(samples[-1, 0]), heard)
            self._activity.feed(samples[:, 1:], rate)
            self.traces["emg"].feed(samples[:, 0], 1e6 * samples[:, 1:])

    def feed_responses(self, rows: np.ndarray) -> None:
        """Process EMG responses, rows of the columns of the topic ``emg/responses``."""
        with self._lock:
            self._responses.extend(rows)

    def new_responses(self) -> list[np.ndarray]:
        """Return the rows of the responses since the last call."""
        with self._lock:
            found = list(self._responses)
            self._responses.clear()
        return found

    def feed_status(
        self, name: str, level: int, message: str, figures: Mapping[str, str], heard: float
    ) -> None:
        """Process the status of a node."""
        with self._lock:
            self.health.feed(name, level, message, figures, heard)

    def snapshot(self, now: float, heard_now: float) -> Snapshot:
        """Return the signals now; `now` is ROS time and `heard_now` monotonic time [s]."""
        with self._lock:
            age = self._estimates.age(now, heard_now)
            if age == math.inf:
                quality = WAITING
            elif age > STALE_AFTER:
                quality = STALE
            else:
                quality = GOOD if self._valid else INVALID
            return Snapshot(
                self._K,
                self._G,
                self._torque.value,
                self._estimates.time,
                age,
                quality,
                _quality(self._samples.age(now, heard_now)),
                self._angle,
                self._activity.values,
                _quality(self._emg.age(now, heard_now)),
            )

    def new_faults(self) -> list[tuple[str, str]]:
        """See `GraphHealth.new_faults`."""
        with self._lock:
            return self.health.new_faults()

    def not_valid(self) -> str:
        """Return why estimates are not valid, in the estimator's words; see `GraphHealth`."""
        with self._lock:
            return self.health.reason()

    def describe(self, heard_now: float) -> dict[str, Any]:
        """Return health, recording and reason, ready for JSON."""
        with self._lock:
            return {
                "nodes": self.health.nodes(heard_now),
                "recording": self.health.recording(heard_now),
                "reason": self.health.reason(),
                "doubt": self.health.doubt(),
            }

    def traces_since(self, seen: Mapping[str, int]) -> dict[str, Any]:
        """Return new bins of every group of traces; see `MinMaxTraces.since`."""
        with self._lock:
            found = {name: group.since(seen.get(name)) for name, group in self.traces.items()}
        return {name: bins for name, bins in found.items() if bins is not None}
