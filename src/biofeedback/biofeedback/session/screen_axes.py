"""Ends of the screen's axes: from protocol and baseline, or set by the operator."""

from __future__ import annotations

from collections.abc import Mapping

from biofeedback.errors import CommandError
from biofeedback.session.axis_calibration import DEFAULT_AXES, torque_axis
from biofeedback.session.session_program import Session


class ScreenAxes:
    """Holds the axes of one session's screens.

    Parameters
    ----------
    session
        Gives targets and baseline.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._set: dict[str, float] = {}

    @property
    def set_by_operator(self) -> list[str]:
        """Return the names of the ends that the operator has set."""
        return sorted(self._set)

    def ends(self) -> dict[str, tuple[float, float]]:
        """Return the ends of ``x`` (feedback, in its unit) and ``y`` (torque [N.m])."""
        session, feedback = self._session, self._session.target.feedback
        if session.conditioning is not None:
            x = session.conditioning.axis()
        elif session.baseline is None:
            x = DEFAULT_AXES[feedback]
        else:
            x = session.baseline.axis(feedback)
        y = torque_axis(
            [*session.protocol.targets, session.target.torque], session.protocol.torque_half_width
        )
        return {
            "x": (x[0], self._set.get(f"x_upper {feedback}", x[1])),
            "y": (self._set.get("y_lower", y[0]), self._set.get("y_upper", y[1])),
        }

    def set(self, values: Mapping[str, float | None]) -> None:
        """Set ends; None returns one to the value from protocol and baseline.

        Raises
        ------
        CommandError
            The torque axis would not go up.
        """
        changed = dict(self._set)
        feedback = self._session.target.feedback
        for key, value in values.items():
            name = f"x_upper {feedback}" if key == "x_upper" else key.partition("[")[0]
            changed.pop(name, None)
            if value is not None:
                changed[name] = value
        before, self._set = self._set, changed
        lower, upper = self.ends()["y"]
        if not lower < upper:
            self._set = before
            raise CommandError(f"the torque axis must go up: {lower:g} to {upper:g} N.m is refused")
