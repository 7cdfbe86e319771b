"""The path that the plate follows: from where it was held, softly into the reference, with the
yielding to torque added, and no further than the limits allow.
"""

from __future__ import annotations

import math

import numpy as np

from ankle_actuator_driver.safety.command_record import CommandRecord
from ankle_actuator_driver.safety.continuation import (
    LARGEST_BLOCK,
    LONGEST_BUFFER,
    RESUME_MARGIN,
    Continuation,
    Decision,
    Verdict,
    contradiction,
    even_interval,
)
from ankle_actuator_driver.safety.limits import Limits
from ankle_actuator_driver.safety.rig import Stretch
from ankle_actuator_driver.safety.soft_start import blend
from ankle_actuator_driver.safety.torque_yield import TorqueYield


class ReferencePath:
    """Turns each stretch of reference into what is sent, and remembers it.

    Parameters
    ----------
    yielding
        What is added to the reference where the torque is too large.

    Attributes
    ----------
    held
        Where the plate was held when the path began [rad].
    """

    def __init__(self, yielding: TorqueYield) -> None:
        self.held = 0.0
        self._yield = yielding
        self._began, self._soft_start = math.nan, 0.0
        self._continuation, self._record = Continuation(), CommandRecord()

    @property
    def end(self) -> float:
        """Return the ROS time of the last sample sent [s]; NaN before the first one."""
        return self._continuation.end

    def hold(self, position: float) -> None:
        """Note that the plate is held at a position [rad]."""
        self._record.hold(position)

    def begin(self, held: float, soft_start: float) -> None:
        """Begin anew at a position [rad], with a start of a duration [s]."""
        self.held, self._began, self._soft_start = held, math.nan, soft_start
        self._continuation.begin(held)
        self._record.hold(held)

    def positions(self, time: np.ndarray) -> np.ndarray:
        """Return the commanded positions [rad] at ROS times [s], shape (n,)."""
        return self._record.positions(time)

    def to_come(self, ros: float) -> np.ndarray:
        """Return the motion that was sent and is not due yet at a ROS time [s], shape (n, 3)."""
        return self._record.to_come(ros)

    def follow(
        self, time: np.ndarray, motion: np.ndarray, limits: Limits, ros: float
    ) -> tuple[Decision, Stretch | None]:
        """Decide what becomes of a stretch of reference.

        Parameters
        ----------
        time
            ROS times at which it is to be followed [s], shape (n,).
        motion
            Position [rad], velocity [rad/s], acceleration [rad/s^2], shape (n, 3).
        limits
            That the path keeps.
        ros
            ROS time now [s].

        Returns
        -------
        tuple of Decision and (Stretch or None)
            The decision, and what is to be sent; None where it is not followed.
        """
        if len(time) > LARGEST_BLOCK:
            return _left_out(f"a block of {len(time)} samples is longer than {LARGEST_BLOCK}")
        interval = even_interval(time)
        if interval is None or not np.isfinite(motion).all():
            return _left_out("a block that is not finite or not evenly spaced is not followed")
        turn = self._turn(time, motion, interval, limits, ros)
        if turn.verdict is not Verdict.FOLLOWED:
            return turn, None
        if math.isnan(self._began):
            # A start lies ahead, whatever the block's first samples are.
            kept = time > ros + RESUME_MARGIN
            if np.count_nonzero(kept) < 2:
                return _left_out("a block too late for the start")
            time, motion = time[kept], motion[kept]
            self._began = float(time[0])
        since = np.maximum(time - self._began, 0.0)
        shaped = blend(motion, since, self._soft_start, self.held)
        self._yield.soften(float(time[-1]) - ros)
        shaped = shaped + self._yield.stretch(len(time), interval)
        decision = self._continuation.judge(time, shaped, limits, ros)
        if decision.verdict is not Verdict.FOLLOWED:
            return decision, None
        self._continuation.accept(time, shaped)
        self._record.add(time, shaped, ros)
        return decision, Stretch(time, shaped)

    def _turn(
        self, time: np.ndarray, motion: np.ndarray, interval: float, limits: Limits, ros: float
    ) -> Decision:
        """Return whether a finite, evenly spaced stretch comes in its time and turn, and whether
        its columns agree.
        """
        ahead = float(time[-1]) - ros
        if not 0.0 < ahead < LONGEST_BUFFER:
            early = (
                f"is {1e3 * -ahead:.0f} ms late"
                if ahead <= 0
                else f"is {ahead:.3g} s ahead of its time"
            )
            return Decision(
                Verdict.LEFT_OUT,
                f"a block {early} and is not followed; see perturbation_generator.lead and "
                "reference_delay",
            )
        turn = self._continuation.order_of(time, interval)
        if turn.verdict is not Verdict.FOLLOWED:
            return turn
        contradicting = contradiction(motion, interval, limits)
        if contradicting:
            return Decision(Verdict.FAULT, f"reference refused: {contradicting}")
        return turn


def _left_out(why: str) -> tuple[Decision, None]:
    return Decision(Verdict.LEFT_OUT, why), None
