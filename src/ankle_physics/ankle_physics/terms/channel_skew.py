"""Time between the channels: torque read ``skew`` later than position (negative: earlier)."""

from __future__ import annotations

import numpy as np

from ankle_physics.linear_dynamics import Delay
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Turn, Values

# [s] Where a search begins. A torque without noise above 20 Hz tells tenths of a millisecond, and 4
# ms away from the right value it is described no better than without any skew.
TRIED_S = tuple(sign * 0.001 * size for sign in (-1, 1) for size in (0.5, 1, 2, 4, 8, 16))


class ChannelSkew(Term):
    """Models two acquisition cards, or a driver that buffers one channel.

    Simulation delays the channel that is late. By reasoning: buffers of fixed length delay a
    channel by a constant time.
    """

    name = "channel_skew"
    place = Place.TORQUE_SENSOR
    family = "torque channel timing"
    separated_by = "fast pulses with the foot out of the plate"
    sentence = "The torque and position channels are not read at the same moment."
    turn = Turn(
        "skew",
        0.0,
        "The torque channel is read earlier than the position channel.",
        "The torque channel is read later than the position channel.",
    )
    parameters = (
        Parameter(
            "skew",
            "s",
            -0.02,
            0.02,
            0.003,
            "one to a few sample blocks; 20 ms and more is a broken recording, not a finding",
            description=(
                "It says how much later the torque is read than the position; a negative value "
                "means earlier."
            ),
            tried=TRIED_S,
        ),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        longest = self.parameter("skew").upper
        return {"torque": Delay(rate, longest), "position": Delay(rate, longest)}

    def transform(self, signals: Signals, values: Values, state: State) -> None:
        skew = float(values["skew"])
        signals.torque = state["torque"].run(signals.torque, max(skew, 0.0))
        signals.measured_position = state["position"].run(
            signals.measured_position, max(-skew, 0.0)
        )

    def response(self, frequency: np.ndarray, values: Values) -> np.ndarray:
        return np.exp(-2j * np.pi * frequency * float(values["skew"]))
