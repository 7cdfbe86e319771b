"""Torque that no named physics explains: ``torque = size * sum_l h_l f(u(t - lag_l))``, a static
curve of one signal and linear dynamics behind it.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values

# The signal u, by the number that a model file states.
INPUTS = (
    "dorsiflexion velocity",
    "plantarflexion velocity",
    "position",
    "velocity",
    "acceleration",
)
# Middles of the triangular windows in which the response is stated [s]; the last one reaches on.
LAGS_S = (0.0, 0.01, 0.02, 0.035, 0.05, 0.075, 0.1, 0.14, 0.19, 0.26, 0.36, 0.5)
_TAIL_S = 0.2
LEVELS = 7
_SOURCE = "from the recording in which it was found"


def _levels() -> tuple[Parameter, ...]:
    points = []
    for k in range(1, LEVELS + 1):
        points += [
            Parameter(
                f"u{k}",
                "1",
                -1e4,
                1e4,
                float(k - 4),
                _SOURCE,
                description=f"It is the signal at point {k} of the static curve.",
                fitted=False,
            ),
            Parameter(
                f"f{k}",
                "1",
                -1e3,
                1e3,
                0.0,
                _SOURCE,
                description=f"It is the value of the static curve at point {k}.",
                fitted=False,
            ),
        ]
    return tuple(points)


class MissingBlock(Term):
    """Models an effect that a diagnosis could describe and not name: a Hammerstein block.

    Source: Westwick & Kearney 2003, Identification of Nonlinear Physiological Systems, chapter 6.

    Its numbers hold for movements like those that it was found in.
    """

    name = "missing_block"
    place = Place.INTRINSIC
    searched = False
    has_memory = True
    sentence = "Something that no term of the library explains answers the movement."
    parameters = (
        Parameter(
            "size",
            "1",
            -10.0,
            10.0,
            1.0,
            "1 is what the recording showed",
            description="It multiplies the whole torque of the block.",
            linear=True,
        ),
        Parameter(
            "input",
            "1",
            0.0,
            float(len(INPUTS) - 1),
            2.0,
            _SOURCE,
            description=(
                "It is the number of the signal that the block answers, from the list in this "
                "term's file."
            ),
            fitted=False,
        ),
        Parameter(
            "xc",
            "rad",
            -1.0,
            1.0,
            0.0,
            "mean angle of the recording",
            description="It is the angle from which the position is counted.",
            fitted=False,
        ),
        *_levels(),
        *(
            Parameter(
                f"h{k}",
                "N.m/s",
                -1e5,
                1e5,
                0.0,
                _SOURCE,
                description=f"It is the impulse response {lag:g} s after the movement.",
                fitted=False,
            )
            for k, lag in enumerate(LAGS_S, start=1)
        ),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {"rate": rate, "past": np.zeros(int((LAGS_S[-1] + _TAIL_S) * rate) + 1)}

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        signal = self._input(signals, values)
        levels = [float(values[f"u{k}"]) for k in range(1, LEVELS + 1)]
        curve = [float(values[f"f{k}"]) for k in range(1, LEVELS + 1)]
        past = state["past"]
        known = np.concatenate([past, np.interp(signal, levels, curve)])
        response = self.impulse_response(values, state["rate"], len(past))
        state["past"] = known[len(known) - len(past) :]
        torque = np.convolve(known, response, mode="full")[len(past) : len(known)]
        return {"size": torque / state["rate"]}

    @staticmethod
    def impulse_response(values: Values, rate: float, length: int) -> np.ndarray:
        """Return the torque after a unit impulse of the curve's output [N.m/s], shape (length,)."""
        heights = [float(values[f"h{k}"]) for k in range(1, len(LAGS_S) + 1)]
        lags = [*LAGS_S, LAGS_S[-1] + _TAIL_S]
        return np.asarray(np.interp(np.arange(length) / rate, lags, [*heights, 0.0]))

    @staticmethod
    def _input(signals: Signals, values: Values) -> np.ndarray:
        name = INPUTS[round(float(values["input"]))]
        if name == "position":
            return signals.foot_position - float(values["xc"])
        if name == "acceleration":
            return signals.foot_acceleration
        if name == "dorsiflexion velocity":
            return np.maximum(signals.foot_velocity, 0.0)
        if name == "plantarflexion velocity":
            return np.minimum(signals.foot_velocity, 0.0)
        return signals.foot_velocity
