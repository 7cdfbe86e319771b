"""The one place where session, signals and commands meet: what every page shows is made here, once
for all of them.

Belongs to the server's thread. Everything that two operators could see differently (session,
targets, axes) is state of the desk; each change makes a new version, and pages show the newest.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any, Protocol

import numpy as np

from ankle_node.session_event import SessionEvent
from biofeedback.errors import CommandError
from biofeedback.live_signals import GOOD, LiveSignals
from biofeedback.session.axis_calibration import DEFAULT_AXES, torque_axis
from biofeedback.session.protocol import BREAK, UNITS
from biofeedback.session.session_program import ARMED, FINISHED, PAUSED, RUNNING, Reading, Session
from biofeedback.web.cursor import NATURAL_FREQUENCY, Cursor
from biofeedback.web.operator_commands import Command

LOG_LINES = 30
RIG_PATIENCE = 1.5
"""[s] A rig that has agreed to start says that it runs within milliseconds; its driver's death is
seen within a second.
"""
_TARGET_FIELDS = {
    "feedback": "feedback",
    "torque[N.m]": "torque",
    "torque_half_width[N.m]": "torque_half_width",
}
_TARGET_FIELDS |= {"lower": "lower", "upper": "upper"}


class Rig(Protocol):
    """The actuator's driver, as far as an operator steers it."""

    def describe(self) -> dict[str, Any]:
        """Ready for JSON: ``name`` (None where there is none), ``problem``, ``state`` (a word, then
        its reason; empty if it says none).
        """

    @property
    def present(self) -> bool:
        """Whether there is one to steer."""

    async def call(self, action: str) -> None:
        """Carry out ``arm``, ``start``, ``stop`` or ``reset_fault``; raises `CommandError` with the
        rig's own reason.
        """

    def tell(self, action: str) -> None:
        """The same without waiting for the answer."""


class Person(Protocol):
    """A simulated subject who can be told what to do."""

    def describe(self) -> dict[str, float] | None:
        """Present values; None where there is no simulated subject."""

    async def tell(self, values: Mapping[str, float]) -> None:
        """Change what the subject does; raises `CommandError`."""


class Desk:
    """Makes frames (many a second) and states (when something changes), and carries out commands.

    Parameters
    ----------
    session
        That is led through.
    signals
        From the graph.
    rig, person
        What commands act on.
    on_event
        Called with each session event.
    cursor_frequency
        See `Cursor` [Hz].
    """

    def __init__(
        self,
        session: Session,
        signals: LiveSignals,
        rig: Rig,
        person: Person,
        on_event: Callable[[SessionEvent], None],
        cursor_frequency: float = NATURAL_FREQUENCY,
    ) -> None:
        self.session = session
        self._signals = signals
        self._rig = rig
        self._person = person
        self._on_event = on_event
        self._cursor_frequency = cursor_frequency
        self._cursor = Cursor(cursor_frequency)
        self._shown = session.target.feedback
        self._axes: dict[str, float] = {}
        self._log: deque[dict[str, Any]] = deque(maxlen=LOG_LINES)
        self._heard = math.nan
        self._frames = 0
        self._rig_agreed_at: float | None = None
        self.now = math.nan

    def frame(self, now: float, heard_now: float) -> dict[str, Any]:
        """What the screens show at this moment, and the session's progress until it.

        Parameters
        ----------
        now
            ROS time [s].
        heard_now
            Monotonic time [s].
        """
        self.now = now
        session = self.session
        for name, message in self._signals.new_faults():
            self._happened([SessionEvent("fault", now, {"node": name, "message": message[:300]})])
        self._follow_rig(heard_now)
        found = self._signals.snapshot(now, heard_now)
        torque = found.torque - (session.baseline.torque if session.baseline is not None else 0.0)
        reading = Reading(
            found.K, found.G, torque, found.quality == GOOD and found.torque_quality == GOOD
        )
        before = session.state
        self._happened(session.tick(now, reading))
        if before == RUNNING and session.state != RUNNING:
            self._rig.tell("stop")
        target = session.target
        if target.feedback != self._shown:
            self._cursor, self._shown = Cursor(self._cursor_frequency), target.feedback
        wanted = np.array([found.K if target.feedback == "K" else found.G, torque])
        wanted[0] = wanted[0] if found.quality == GOOD else math.nan
        wanted[1] = wanted[1] if found.torque_quality == GOOD else math.nan
        passed = 0.0 if math.isnan(self._heard) else min(max(heard_now - self._heard, 0.0), 1.0)
        self._heard = heard_now
        x, y = self._cursor.advance(wanted, passed).tolist()
        self._frames += 1
        return {
            "type": "frame",
            "n": self._frames,
            "now": round(now, 3),
            "t": _number(found.estimate_time),
            "x": _number(x),
            "y": _number(y),
            "quality": found.quality,
            "torque_quality": found.torque_quality,
            "age": _number(found.age),
            "in_target": target.reached(reading),
            "elapsed": round(session.elapsed, 2),
            "remaining": round(session.remaining, 2),
            "clock": round(session.clock, 2),
        }

    def state(self, heard_now: float) -> dict[str, Any]:
        """Everything else that the pages show, ready for JSON."""
        session = self.session
        target, step = session.target, session.step
        return {
            "session": {
                "state": session.state,
                "title": session.protocol.title,
                "kind": step.kind,
                "block": step.block,
                "blocks": session.protocol.blocks,
                "hold": step.hold,
                "holds": session.protocol.holds,
                "duration": step.duration,
                "hold_share": [_number(share) for share in session.hold_share],
                "instruction": instruction(session),
            },
            "target": {**asdict(target), "unit": UNITS[target.feedback]},
            "axes": self.axes(),
            "own_axes": sorted(self._axes),
            "baseline": None if session.baseline is None else asdict(session.baseline),
            "rig": self._rig.describe(),
            "person": self._person.describe(),
            "log": list(self._log),
            **self._signals.describe(heard_now),
        }

    def axes(self) -> dict[str, list[float]]:
        """Ends of the x- and y-axis in the units of feedback and torque."""
        session, feedback = self.session, self.session.target.feedback
        x = DEFAULT_AXES[feedback] if session.baseline is None else session.baseline.axis(feedback)
        y = torque_axis(
            [*session.protocol.targets, session.target.torque], session.protocol.torque_half_width
        )
        return {
            "x": [x[0], self._axes.get(f"x_upper {feedback}", x[1])],
            "y": [self._axes.get("y_lower", y[0]), self._axes.get("y_upper", y[1])],
        }

    async def carry_out(self, command: Command) -> None:
        """Do what an operator asks.

        Raises
        ------
        CommandError
            Refused, by us, by the rig or by the simulated subject.
        """
        session, name, values = self.session, command.name, command.values
        if name == "stop":
            # The rig first, and nothing waits for its answer: the stop is the one command that must
            # not queue.
            self._rig.tell("stop")
            self._happened(session.stop(self.now))
        elif name == "pause":
            self._happened(session.pause(self.now))
            self._rig.tell("stop")
        elif name in ("arm", "start"):
            await self._with_rig(name)
        elif name == "reset_fault":
            if not self._rig.present:
                raise CommandError("no rig driver answers; there is no fault to reset")
            await self._rig.call(name)
        elif name == "set_target":
            self._happened(
                session.set_target(
                    self.now, {_TARGET_FIELDS[key]: value for key, value in values.items()}
                )
            )
        elif name == "set_axis":
            self._set_axis(values)
        elif name == "person":
            await self._person.tell(values)
        elif name == "note":
            self._happened([SessionEvent("note", self.now, {"text": values["text"]})])
        else:
            steps = {
                "next": session.next,
                "start_hold": session.start_hold,
                "end_hold": session.end_hold,
                "restart": session.restart,
            }
            self._happened(steps[name](self.now))
            if session.state in (PAUSED, FINISHED):
                self._rig.tell("stop")

    async def _with_rig(self, name: str) -> None:
        """Arm or start: the session follows only where the rig has agreed."""
        session = self.session
        if name == "start" and session.state != "armed":
            session.start(self.now)  # raises, with its reason
        if name == "arm" and session.state not in ("idle", "paused"):
            session.arm(self.now)
        self._rig_agreed_at = None
        if self._rig.present:
            await self._rig.call(name)
            self._rig_agreed_at = self._heard
        try:
            self._happened(session.arm(self.now) if name == "arm" else session.start(self.now))
        except CommandError:
            # Somebody stopped the session while the rig was answering: the rig must not stay armed
            # for nobody.
            self._rig.tell("stop")
            raise

    def _follow_rig(self, heard_now: float) -> None:
        """A session that goes with a rig stops when the rig does: for a fault, by another's
        command, because its driver is gone.
        """
        session, agreed = self.session, self._rig_agreed_at
        if (
            agreed is None
            or session.state not in (ARMED, RUNNING)
            or heard_now - agreed < RIG_PATIENCE
        ):
            return
        said = self._rig.describe()["state"]
        if self._rig.present and said.split(":")[0] in ("", session.state):
            return
        reason = (
            f"the rig is not {session.state}: {said}"
            if self._rig.present
            else "the rig's driver is gone"
        )
        self._rig.tell("stop")
        self._happened(session.stop(self.now, reason))

    def _set_axis(self, values: Mapping[str, float | None]) -> None:
        changed = dict(self._axes)
        feedback = self.session.target.feedback
        for key, value in values.items():
            name = f"x_upper {feedback}" if key == "x_upper" else key.partition("[")[0]
            changed.pop(name, None)
            if value is not None:
                changed[name] = value
        before, self._axes = self._axes, changed
        lower, upper = self.axes()["y"]
        if not lower < upper:
            self._axes = before
            raise CommandError(f"the torque axis must go up: {lower:g} to {upper:g} N.m is refused")

    def happened(self, events: list[SessionEvent]) -> None:
        """Publish and log events that came about elsewhere."""
        self._happened(events)

    def _happened(self, events: list[SessionEvent]) -> None:
        for event in events:
            self._on_event(event)
            self._log.append({"t": event.time, "event": event.event, "details": event.details})


def instruction(session: Session) -> str:
    """What the subject is asked for now, in a few words."""
    step = session.step
    if session.state == FINISHED:
        return "Finished. Thank you!"
    if step.kind == BREAK:
        return "Break"
    if session.state == PAUSED:
        return "Paused"
    if session.state != RUNNING:
        return "Please wait"
    return {
        "baseline": "Relax your foot",
        "reach": "Move into the target",
        "hold": "Hold it there",
    }[step.kind]


def _number(value: float) -> float | None:
    return round(value, 6) if math.isfinite(value) else None
