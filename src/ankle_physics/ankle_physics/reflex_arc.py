"""What the terms of the reflexes share: a delay, and a muscle that answers what drives it."""

from __future__ import annotations

import numpy as np

from ankle_physics.linear_dynamics import Delay, SecondOrder
from ankle_physics.term import Parameter, State, Term, Values

# As the short-latency reflex of van 't Veld et al. 2018, section III-A: the muscle is of the same
# kind.
MUSCLE_DAMPING = 0.8
MUSCLE_FREQUENCY = Parameter(
    "omega",
    "rad/s",
    5.0,
    80.0,
    21.0,
    "van 't Veld et al. 2018, section III-A",
    description="It is the natural frequency of the muscle's response.",
)
# Of terms that change the gain of the short-latency reflex and so act through the same arc.
SHORT_LATENCY = Parameter(
    "delay",
    "s",
    0.025,
    0.08,
    0.04,
    "as the reflex: 35 to 50 ms",
    description=(
        "It is the time from the stretch to the first activity of the short-latency reflex."
    ),
)

# A reflex arc takes 40 ms or more, and its torque has gone after 300 ms. Steps of 30 ms would let a
# reflex take the stiffness of a relaxed ankle away.
RESPONSE_LAGS = np.arange(0.04, 0.3, 0.02)  # s


def late_stretches(velocity: np.ndarray, rate: float) -> list[np.ndarray]:
    """Return what reflexes of any kind may answer: stretches of either direction at each of
    `RESPONSE_LAGS`, each of shape (n,) and in units of the fastest.

    Parameters
    ----------
    velocity
        In any unit, shape (n,).
    rate
        Of its samples [Hz].
    """
    found = []
    for direction in (1.0, -1.0):
        stretch = np.maximum(direction * velocity, 0.0)
        size = float(np.max(stretch, where=np.isfinite(stretch), initial=0.0))
        for lag in np.round(RESPONSE_LAGS * rate).astype(int):
            before = np.zeros(min(lag, len(stretch)))
            found.append(np.concatenate([before, stretch])[: len(stretch)] / (size or 1.0))
    return found


class ReflexArc(Term):
    """Describes a term whose torque is a muscle's response to a delayed drive.

    ``torque = w^2/(s^2 + 2 z w s + w^2) * drive(t - delay)`` for each unit of its gain. A subclass
    has the parameters ``delay`` and ``omega`` and gives the drive in `torque`.
    """

    def start(self, rate: float, seed: int = 0) -> State:
        """Make the state for a run at `rate` [Hz]: the delay line and the muscle."""
        return {
            "delay": Delay(rate, longest=self.parameter("delay").upper),
            "muscle": SecondOrder(rate),
        }

    @staticmethod
    def response_to(
        drive: np.ndarray, values: Values, state: State, damping: float = MUSCLE_DAMPING
    ) -> np.ndarray:
        """Return the muscle's response to the drive, delayed.

        Parameters
        ----------
        drive
            Shape (n,), in any unit.
        values
            Of the term: ``delay`` [s] and ``omega`` [rad/s].
        state
            From `start`; it is advanced by n samples.
        damping
            Damping ratio of the muscle's response.

        Returns
        -------
        ndarray
            Shape (n,), in the unit of the drive.
        """
        delayed = state["delay"].run(drive, float(values["delay"]))
        return state["muscle"].run(delayed, float(values["omega"]), damping)
