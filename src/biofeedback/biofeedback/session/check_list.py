"""The visit's check list: what is done with rig and subject before the first block.

A protocol names its checks (`check_list`); the operator's page leads through them, and the session
cannot be armed before each one is done or, with a word in the recording, skipped. The results are
written into the recording: they are what K and G are referred to later.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ankle_node.session_event import SessionEvent
from biofeedback.errors import CommandError, ProtocolError

SESSION_CALIBRATION, CALIBRATE_RIG = "session_calibration", "calibrate_rig"
OPEN, RUNNING, DONE, FAILED, SKIPPED = "open", "running", "done", "failed", "skipped"
RELAXED_SPREAD = 0.5
"""[N.m] Standard deviation of the torque of a subject who is relaxed: half the narrowest band that
the protocols ask subjects to hold.
"""
LEAST_RANGE = 0.1
"""[rad] Range of motion that a session needs: the paper's perturbation of 0.04 rad to both sides,
and room for the servo's overshoot.
"""
LEAST_CONTRACTION = 2.0
"""[N.m] Least torque of a maximal voluntary contraction: the protocols ask for 5."""
PLATEAU = 15
"""Number of readings of a maximum, 0.5 s at 30 in a second: a maximum is what is held for so long,
not a peak."""


@dataclass(frozen=True)
class Check:
    """Describes one entry of the check list.

    Attributes
    ----------
    title
        For the operator.
    instruction
        What operator and subject do.
    duration
        [s] for which signals are gathered; 0: the operator confirms, or a file answers.
    required
        Whether it cannot be skipped, since somebody could be hurt.
    """

    title: str
    instruction: str
    duration: float = 0.0
    required: bool = False


CHECKS = {
    "rig_calibration": Check("Rig calibration in date", "Read from the rig's calibration file."),
    "zero": Check("Zero", "Foot on the plate, relaxed; nobody touches the rig.", 5.0),
    "range_of_motion": Check(
        "Range of motion",
        "Move the plate by hand, slowly, to both ends that are comfortable.",
        20.0,
    ),
    "mvc_plantarflexion": Check(
        "Maximal push, toes down", "Push down as hard as possible for three seconds.", 6.0
    ),
    "mvc_dorsiflexion": Check(
        "Maximal lift, toes up", "Lift up as hard as possible for three seconds.", 6.0
    ),
    "warm_up": Check("Warm-up", "Push and lift gently, five times each; then confirm."),
    SESSION_CALIBRATION: Check(
        "Session calibration",
        "Begins with the perturbation, after arm and start; the subject relaxes.",
    ),
    "no_foot_on_plate": Check(
        "No foot on the plate",
        "Nobody sits in the rig, nothing loose is on the plate, all hands are away; then confirm.",
        required=True,
    ),
    "spring_on_plate": Check(
        "Spring on the plate",
        "The known spring is mounted, and nothing else; then confirm.",
        required=True,
    ),
    CALIBRATE_RIG: Check(
        "Rig calibration", "Arm and start: the plate then moves by itself for two minutes."
    ),
}


def checked_names(content: Any, name: str) -> tuple[str, ...]:
    """Return the names of a file's check list.

    Parameters
    ----------
    content
        Of the key ``check_list``.
    name
        Name of the file that lists them.

    Raises
    ------
    ProtocolError
        No list, an unknown check, or one that is named twice.
    """
    if not isinstance(content, list):
        raise ProtocolError(f"{name}: 'check_list' is a list of checks")
    for entry in content:
        if not isinstance(entry, str) or entry not in CHECKS:
            raise ProtocolError(f"{name}: check '{entry}' is unknown; allowed: {', '.join(CHECKS)}")
    if len(set(content)) < len(content):
        raise ProtocolError(f"{name}: 'check_list' names a check twice")
    return tuple(content)


@dataclass(frozen=True)
class BodyReading:
    """Holds the signals that a check needs, at one moment.

    Attributes
    ----------
    torque
        The subject's [N.m], plantarflexion negative.
    angle
        Of the plate [rad].
    emg
        Rectified and smoothed, by muscle [V].
    """

    torque: float
    angle: float
    emg: Mapping[str, float] = field(default_factory=dict)


class CheckList:
    """Keeps the check list of one visit.

    Parameters
    ----------
    names
        Keys of `CHECKS`, in order.
    from_files
        What answers an entry from a file, by its name: gives the result, or raises `CommandError`.
    in_motion
        Entries that need the running perturbation, which is started before them.

    Attributes
    ----------
    states
        `OPEN`, `RUNNING`, `DONE`, `FAILED` or `SKIPPED`, by name.
    results
        Figures with their units, or what is wrong, by name.
    """

    def __init__(
        self,
        names: tuple[str, ...],
        from_files: Mapping[str, Callable[[], Mapping[str, Any]]] | None = None,
        in_motion: Collection[str] = (),
    ) -> None:
        self.names = names
        self.in_motion = tuple(name for name in names if name in in_motion)
        self._from_files = dict(from_files or {})
        self.states = dict.fromkeys(names, OPEN)
        self.results: dict[str, dict[str, Any]] = {name: {} for name in names}
        self._running: str | None = None
        self._began = math.nan
        self._readings: list[BodyReading] = []

    @property
    def missing(self) -> list[str]:
        """Return the titles of the checks that are neither done nor skipped before the
        perturbation.
        """
        return [
            CHECKS[name].title
            for name, state in self.states.items()
            if state not in (DONE, SKIPPED) and name not in self.in_motion
        ]

    def begin(self, name: str, now: float) -> None:
        """Gather signals for a check, from `now` [s] on, or confirm one that needs none.

        Raises
        ------
        CommandError
            It is not of this visit, or another one is being measured.
        """
        self._require(name)
        if self._running is not None:
            raise CommandError(f"'{CHECKS[self._running].title}' is being measured")
        if name in self._from_files:
            self._read(name)
            return
        if CHECKS[name].duration == 0.0:
            self.states[name] = DONE
            return
        self.states[name], self._running = RUNNING, name
        self._began, self._readings = now, []

    def read_files(self, another_subject: bool = False) -> list[str]:
        """Answer every open entry that a file answers; return the names of those that are done.

        Parameters
        ----------
        another_subject
            Whether a file of the entries `in_motion` may be of the subject before, and is not read.
        """
        names = [n for n in self.names if n in self._from_files and self.states[n] == OPEN]
        if another_subject:
            names = [name for name in names if name not in self.in_motion]
        for name in names:
            self._read(name)
            if name in self.in_motion and self.states[name] == FAILED:
                self.states[name], self.results[name] = OPEN, {}  # it is not its time yet
        return [name for name in names if self.states[name] == DONE]

    def run(self, name: str, progress: str) -> None:
        """Note that a program works on an entry, and what it does now."""
        self.states[name], self.results[name] = RUNNING, {"progress": progress}

    def finish(self, name: str, problem: str, figures: Mapping[str, Any]) -> None:
        """Note what a program found, or what its problem was."""
        self.states[name] = FAILED if problem else DONE
        self.results[name] = {"problem": problem} if problem else dict(figures)

    def from_file(self, name: str) -> bool:
        """Return whether a file answers an entry."""
        return name in self._from_files

    def _read(self, name: str) -> None:
        try:
            self.results[name] = dict(self._from_files[name]())
            self.states[name] = DONE
        except CommandError as error:
            self.results[name] = {"problem": str(error)}
            self.states[name] = FAILED

    def event(self, name: str, now: float) -> SessionEvent:
        """Return the event that records what came of an entry, at ROS time `now` [s]."""
        word = "failed" if self.states[name] == FAILED else "done"
        return SessionEvent(f"check {word}", now, {"check": name, **self.results[name]})

    def skip(self, name: str) -> None:
        """Leave a check out.

        Raises
        ------
        CommandError
            It is not of this visit, or required.
        """
        self._require(name)
        if CHECKS[name].required:
            raise CommandError(f"'{CHECKS[name].title}' cannot be skipped: confirm it")
        if self._running == name:
            self._running = None
        self.states[name] = SKIPPED

    def _require(self, name: str) -> None:
        if name not in self.states:
            raise CommandError(
                f"'{name}' is not in this protocol's check list "
                f"({', '.join(self.names) or 'empty'})"
            )

    def remaining(self, now: float) -> float:
        """Return how long the present measurement still takes [s]; 0 where there is none."""
        if self._running is None:
            return 0.0
        return max(CHECKS[self._running].duration - (now - self._began), 0.0)

    def tick(self, now: float, reading: BodyReading) -> str | None:
        """Process a reading; return the name of a check that has just ended.

        Parameters
        ----------
        now
            ROS time [s].
        reading
            Of this moment; one that is not finite is left out.
        """
        if self._running is None:
            return None
        if math.isfinite(reading.torque) and math.isfinite(reading.angle):
            self._readings.append(reading)
        if self.remaining(now) > 0.0:
            return None
        name, self._running = self._running, None
        rest = float(self.results.get("zero", {}).get("torque[N.m]", 0.0))
        problem, figures = _evaluate(name, self._readings, rest)
        self.states[name] = FAILED if problem else DONE
        self.results[name] = {"problem": problem} if problem else figures
        return name

    def saved(self) -> dict[str, Any]:
        """Return what a restarted node needs, ready for JSON."""
        return {
            name: {"state": state, "result": self.results[name]}
            for name, state in self.states.items()
            if state in (DONE, SKIPPED)
        }

    def resume(self, saved: Mapping[str, Any]) -> None:
        """Restore what `saved` returned; checks of another protocol are left out."""
        for name, entry in saved.items():
            if name in self.states and entry.get("state") in (DONE, SKIPPED):
                self.states[name] = entry["state"]
                self.results[name] = dict(entry.get("result", {}))


def _evaluate(name: str, readings: list[BodyReading], rest: float) -> tuple[str, dict[str, float]]:
    """Give what is wrong with a measurement, empty where nothing is, and its figures.

    A contraction is the torque beside that of the relaxed leg, `rest` [N.m].
    """
    if len(readings) < PLATEAU:
        return "no signals came", {}
    torque = np.array([reading.torque for reading in readings])
    angle = np.array([reading.angle for reading in readings])
    if name == "zero":
        spread = float(torque.std())
        if spread > RELAXED_SPREAD:
            return (
                f"the torque moved by {spread:.2g} N.m; a relaxed subject stays within "
                f"{RELAXED_SPREAD:g} N.m",
                {},
            )
        return "", _rounded({"torque[N.m]": torque.mean(), "angle[rad]": angle.mean()})
    if name == "range_of_motion":
        low, high = float(angle.min()), float(angle.max())
        if high - low < LEAST_RANGE:
            return (
                f"the plate was moved by {high - low:.3f} rad; a session needs {LEAST_RANGE:g} rad",
                {},
            )
        return "", _rounded({"lower[rad]": low, "upper[rad]": high})
    return _contraction(-1.0 if name == "mvc_plantarflexion" else 1.0, torque - rest, readings)


def _contraction(
    sign: float, torque: np.ndarray, readings: list[BodyReading]
) -> tuple[str, dict[str, float]]:
    held = np.ones(PLATEAU) / PLATEAU
    largest = float((np.convolve(sign * torque, held, "valid")).max())
    if largest < LEAST_CONTRACTION:
        return (
            f"the largest torque held in this direction was {largest:.2g} N.m; a maximal "
            f"contraction has at least {LEAST_CONTRACTION:g} N.m",
            {},
        )
    emg = {}
    for muscle in next((reading.emg for reading in readings if reading.emg), {}):
        # A reading without EMG, as before its first samples arrive, spoils no other plateau.
        values = [reading.emg.get(muscle, math.nan) for reading in readings]
        activity = np.convolve(values, held, "valid")
        if np.isfinite(activity).any():
            emg[f"{muscle}[V]"] = float(np.nanmax(activity))
    return "", _rounded({"torque[N.m]": sign * largest, **emg})


def _rounded(figures: Mapping[str, float]) -> dict[str, float]:
    return {name: float(f"{value:.4g}") for name, value in figures.items()}
