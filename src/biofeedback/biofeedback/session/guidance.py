"""What the subject is asked to do now, as keys of the pages' message files.

The words themselves, in every language, are in `pages/texts/*.json`.
"""

from __future__ import annotations

import math

from biofeedback.session.conditioning import Conditioning
from biofeedback.session.protocol import BASELINE, BREAK, CALIBRATION
from biofeedback.session.session_program import FINISHED, PAUSED, RUNNING, Session
from biofeedback.session.target import Reading, Target

SETTLING_TIME = 0.7
"""[s] A hint that changes faster than a subject can read and react to it (about 0.25 s to see and
0.5 s to read three words) confuses more than it helps."""


def instruction(session: Session) -> str:
    """Give the key of the present instruction: ``relax``, ``reach``, ``hold``, ``break``,
    ``paused``, ``stopped``, ``wait``, ``finished``, ``trials`` in a conditioning course, or
    ``rig_calibration``.
    """
    if session.state == FINISHED:
        return "finished"
    if session.state != RUNNING and session.stop_reason:
        return "stopped"
    if session.step.kind == BREAK:
        return "break"
    if session.state == PAUSED:
        return "paused"
    if session.state != RUNNING:
        return "wait"
    relaxed = session.step.kind in (CALIBRATION, BASELINE)
    return "relax" if relaxed else session.step.kind


def direction(target: Target, reading: Reading) -> str:
    """Give the key of the hint that leads to the target; empty where there is nothing to say.

    The torque comes first: K and G are those of the asked torque only while it is held.

    Returns
    -------
    str
        ``push_less``, ``push_more`` (toes down), ``lift_less``, ``lift_more`` (toes up), ``calmer``
        or ``livelier`` (the reflex), ``softer`` or ``stiffer`` (the ankle), ``good``, or empty.
    """
    if not reading.valid or not math.isfinite(reading.torque):
        return ""
    error = reading.torque - target.torque
    if abs(error) > target.torque_half_width:
        # Plantarflexion, toes down, is negative.
        if error < 0.0:
            return "lift_more" if target.torque > 0.0 else "push_less"
        return "push_more" if target.torque < 0.0 else "lift_less"
    if target.lower is None or target.upper is None:
        return "good"
    value = reading.K if target.feedback == "K" else reading.G
    if value > target.upper:
        return "softer" if target.feedback == "K" else "calmer"
    if value < target.lower:
        return "stiffer" if target.feedback == "K" else "livelier"
    return "good"


def trial_direction(conditioning: Conditioning, reading: Reading, now: float) -> str:
    """Give the key of the hint of a conditioning course: the result of the last trial for a moment,
    then what leads to the background.

    Returns
    -------
    str
        ``success``, ``miss``, a key of `direction`, ``tense`` or ``relax`` (the muscle), or
        ``steady``.
    """
    result = conditioning.result(now)
    if result:
        return result
    window = conditioning.course.background
    if not math.isfinite(reading.torque) or not math.isfinite(reading.activity):
        return ""
    error = reading.torque - window.torque
    if abs(error) > window.torque_half_width:
        if error < 0.0:
            return "lift_more" if window.torque > 0.0 else "push_less"
        return "push_more" if window.torque < 0.0 else "lift_less"
    if reading.activity > window.emg_upper:
        return "relax"
    return "tense" if reading.activity < window.emg_lower else "steady"


class Guidance:
    """Shows a hint long enough to be read.

    Attributes
    ----------
    shown
        Key of the hint that is shown now.
    """

    def __init__(self) -> None:
        self.shown = ""
        self._candidate, self._since = "", -math.inf

    def update(self, hint: str, now: float) -> str:
        """Process the hint of this moment; return the one to show.

        Parameters
        ----------
        hint
            As `direction` gives it.
        now
            Monotonic time [s].
        """
        if hint != self._candidate:
            self._candidate, self._since = hint, now
        if hint == "" or now - self._since >= SETTLING_TIME:
            self.shown = hint
        return self.shown
