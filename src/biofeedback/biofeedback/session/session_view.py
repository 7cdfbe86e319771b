"""The state of a session at one moment, as screens show it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from ankle_node.session_event import SessionEvent
from biofeedback.session.axis_calibration import Baseline
from biofeedback.session.check_list import CHECKS, CheckList
from biofeedback.session.conditioning import Conditioning
from biofeedback.session.course import CONDITIONED, CONTROL
from biofeedback.session.devices import Rig, Subject
from biofeedback.session.guidance import direction, instruction, trial_direction
from biofeedback.session.protocol import Step
from biofeedback.session.readings import rest_torque
from biofeedback.session.screen_axes import ScreenAxes
from biofeedback.session.session_program import RUNNING, Session
from biofeedback.session.target import Reading, Target


@dataclass(frozen=True)
class SessionView:
    """Holds the state of the session at one moment, for whoever shows it.

    Attributes
    ----------
    state, stop_reason, elapsed, remaining, clock, holds_done, hits
        As of `Session`.
    hold_share
        Of the present or last hold: shares of its time with valid estimates, and in the target.
    baseline, target, step
        As of `Session`.
    rest_torque
        The subject's torque at rest [N.m].
    title, blocks, holds
        Of the protocol.
    instruction, hint
        Keys of the pages' message files, see `guidance`.
    in_target
        Whether the cursor is in the target.
    axes, axes_set
        Ends of the axes, and which of them the operator has set.
    rig, subject
        As the rig and the simulated subject describe themselves.
    log
        Last session events, the oldest first.
    checks
        The visit's check list, by the fields of `messages.CheckState`.
    trials
        Of a conditioning course, by the fields of `messages.TrialsState`; None without one.
    reflex
        The reflex of the last trial, in the target's unit; NaN without a course of EMG reflexes.
    """

    state: str
    stop_reason: str
    elapsed: float
    remaining: float
    clock: float
    hold_share: tuple[float, float]
    holds_done: int
    hits: int
    baseline: Baseline | None
    rest_torque: float
    target: Target
    step: Step
    title: str
    blocks: int
    holds: int
    instruction: str
    hint: str
    in_target: bool
    axes: dict[str, tuple[float, float]]
    axes_set: list[str]
    rig: dict[str, Any]
    subject: dict[str, float] | None
    log: list[SessionEvent]
    checks: list[dict[str, Any]]
    trials: dict[str, Any] | None
    reflex: float


def hint_now(session: Session, reading: Reading, now: float) -> str:
    """Give the key of the hint that leads the subject at ROS time `now` [s]; empty for none."""
    if session.state != RUNNING:
        return ""
    if session.conditioning is not None:
        return trial_direction(session.conditioning, reading, now)
    return direction(session.target, reading) if session.step.level is not None else ""


def view_of(
    session: Session,
    reading: Reading,
    axes: ScreenAxes,
    checks: CheckList,
    rig: Rig,
    subject: Subject,
    log: Iterable[SessionEvent],
    hint: str,
) -> SessionView:
    """Return the view of a session; the arguments are those of its runner."""
    target, conditioning = session.target, session.conditioning
    return SessionView(
        state=session.state,
        stop_reason=session.stop_reason,
        elapsed=session.elapsed,
        remaining=session.remaining,
        clock=session.clock,
        hold_share=(session.hold_shares.valid, session.hold_shares.in_target),
        holds_done=session.holds_done,
        hits=session.hits,
        baseline=session.baseline,
        rest_torque=rest_torque(session, checks.results),
        target=target,
        step=session.step,
        title=session.protocol.title,
        blocks=session.protocol.blocks,
        holds=session.protocol.holds,
        instruction=instruction(session),
        hint=hint,
        in_target=target.reached(reading) if conditioning is None else conditioning.background_held,
        axes=axes.ends(),
        axes_set=axes.set_by_operator,
        rig=rig.describe(),
        subject=subject.describe(),
        log=list(log),
        checks=_checks(checks),
        trials=None if conditioning is None else _trials(conditioning, reading),
        reflex=math.nan if conditioning is None else conditioning.shown_size,
    )


def _checks(checks: CheckList) -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "title": CHECKS[name].title,
            "instruction": CHECKS[name].instruction,
            "measured": CHECKS[name].duration > 0.0,
            "required": CHECKS[name].required,
            "from_file": checks.from_file(name),
            "in_motion": name in checks.in_motion,
            "state": state,
            "result": checks.results[name],
        }
        for name, state in checks.states.items()
    ]


def _trials(conditioning: Conditioning, reading: Reading) -> dict[str, Any]:
    session = conditioning.session
    known = math.isfinite(reading.activity)
    return {
        "session": session.number,
        "sessions": session.course.sessions,
        "done": len(session.trials),
        "planned": session.planned,
        "kind": CONTROL if session.criterion is None else CONDITIONED,
        "success_rate": session.success_rate if math.isfinite(session.success_rate) else None,
        "last_success": None if conditioning.last is None else conditioning.last.success,
        "activity": round(reading.activity, 3) if known else None,
        "activity_window": [
            session.course.background.emg_lower,
            session.course.background.emg_upper,
        ],
        "held": conditioning.background_held,
        "waiting": conditioning.waiting,
    }
