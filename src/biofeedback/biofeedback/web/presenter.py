"""What the pages show: frames and states made of a picture of the session and of the live signals.

The presenter changes nothing. Its only memory is the cursor's smoothing.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from biofeedback.live_signals import GOOD, LiveSignals
from biofeedback.session.conditioning import REFLEX, REFLEX_UNIT
from biofeedback.session.protocol import UNITS
from biofeedback.session.session_view import SessionView
from biofeedback.web import messages
from biofeedback.web.cursor import NATURAL_FREQUENCY, Cursor


class Presenter:
    """Makes frames (many in a second) and states (when something changes).

    Parameters
    ----------
    signals
        The signals that came from the graph.
    cursor_frequency
        See `Cursor` [Hz].
    language
        Of the subject's screen: name of a message file.
    visit
        Subject and visit, as the operator reads them; empty where they are not stated.
    body_mass
        Of the subject [kg]; 0 where it is not stated.
    """

    def __init__(
        self,
        signals: LiveSignals,
        cursor_frequency: float = NATURAL_FREQUENCY,
        language: str = "en",
        visit: str = "",
        body_mass: float = 0.0,
    ) -> None:
        self._signals = signals
        self._cursor_frequency = cursor_frequency
        self._language = language
        self._visit, self._body_mass = visit, body_mass
        self._cursor = Cursor(cursor_frequency)
        self._shown = ""
        self._monotonic = math.nan
        self._frames = 0

    def frame(self, view: SessionView, now: float, monotonic: float) -> messages.Frame:
        """Return what the screens show at this moment.

        Parameters
        ----------
        view
            The session at this moment.
        now
            ROS time [s].
        monotonic
            Monotonic time [s].
        """
        found = self._signals.snapshot(now, monotonic)
        feedback = view.target.feedback
        if feedback != self._shown:
            self._cursor, self._shown = Cursor(self._cursor_frequency), feedback
        torque = found.torque - view.rest_torque
        if feedback == REFLEX:
            value, quality = view.reflex, found.emg_quality
        else:
            value, quality = (found.K if feedback == "K" else found.G), found.quality
        wanted = np.array(
            [
                value if quality == GOOD else math.nan,
                torque if found.torque_quality == GOOD else math.nan,
            ]
        )
        passed = monotonic - self._monotonic
        self._monotonic = monotonic
        x, y = self._cursor.advance(wanted, min(max(passed, 0.0), 1.0) if passed == passed else 0.0)
        self._frames += 1
        return messages.Frame(
            n=self._frames,
            now=round(now, 3),
            t=_finite(found.estimate_time),
            x=_finite(x),
            y=_finite(y),
            quality=quality,
            torque_quality=found.torque_quality,
            age=_finite(found.age),
            K=_finite(found.K) if found.quality == GOOD else None,
            G=_finite(found.G) if found.quality == GOOD else None,
            torque=_finite(torque) if found.torque_quality == GOOD else None,
            in_target=view.in_target,
            hint=view.hint,
            elapsed=round(view.elapsed, 2),
            remaining=round(view.remaining, 2),
            clock=round(view.clock, 2),
        )

    def state(
        self, view: SessionView, monotonic: float, pages: messages.Pages, version: int = 0
    ) -> messages.State:
        """Return everything else that the pages show.

        Parameters
        ----------
        view
            The session at this moment.
        monotonic
            Monotonic time [s].
        pages
            The pages that are open.
        version
            Number of the state, counted by the caller.
        """
        described = self._signals.describe(monotonic)
        baseline = view.baseline
        return messages.State(
            version=version,
            session=_session(view),
            target=messages.TargetState(
                view.target.feedback,
                UNITS.get(view.target.feedback, REFLEX_UNIT),
                view.target.torque,
                view.target.torque_half_width,
                view.target.lower,
                view.target.upper,
            ),
            axes=messages.Axes(list(view.axes["x"]), list(view.axes["y"]), view.axes_set),
            baseline=None
            if baseline is None
            else messages.BaselineState(baseline.K, baseline.G, baseline.torque),
            rig=messages.RigState(**view.rig),
            subject=None if view.subject is None else messages.SubjectState(**view.subject),
            log=[messages.LogEntry(event.time, event.event, event.details) for event in view.log],
            nodes=[messages.NodeState(**node) for node in described["nodes"]],
            recording=messages.Recording(**described["recording"]),
            reason=described["reason"],
            doubt=described["doubt"],
            pages=pages,
            language=self._language,
            checks=[messages.CheckState(**check) for check in view.checks],
            visit=self._visit,
            body_mass=self._body_mass or None,
            trials=None if view.trials is None else messages.TrialsState(**view.trials),
        )

    def traces(self, seen: dict[str, int]) -> messages.TracesMessage | None:
        """Return the bins of every group after those in `seen`; None where there is nothing new."""
        found: dict[str, dict[str, Any]] = self._signals.traces_since(seen)
        if not found:
            return None
        widths = {name: group.width for name, group in self._signals.traces.items()}
        return messages.TracesMessage(
            {name: messages.Bins(**bins) for name, bins in found.items()}, widths
        )


def _session(view: SessionView) -> messages.SessionState:
    step = view.step
    return messages.SessionState(
        state=view.state,
        stop_reason=view.stop_reason,
        title=view.title,
        kind=step.kind,
        block=step.block,
        blocks=view.blocks,
        hold=step.hold,
        holds=view.holds,
        duration=step.duration,
        hold_share=[_finite(share) for share in view.hold_share],
        holds_done=view.holds_done,
        hits=view.hits,
        instruction=view.instruction,
    )


def _finite(value: float) -> float | None:
    return round(float(value), 6) if math.isfinite(value) else None
