"""First-order lag of the torque channel: ``T * Tm' + Tm = T_joint``."""

from __future__ import annotations

import numpy as np

from ankle_physics.linear_dynamics import FirstOrder
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values


class TorqueSensorLag(Term):
    """Models the filter of a bridge amplifier, or a sensor softer than it should be.

    By reasoning: such a filter is a low-pass of the first order.
    """

    name = "torque_sensor_lag"
    place = Place.TORQUE_SENSOR
    family = "torque channel timing"
    separated_by = "fast pulses with the foot out of the plate"
    sentence = "The torque channel smooths and lags behind: a filter in front of the recording."
    parameters = (
        Parameter(
            "T",
            "s",
            0.0003,
            0.05,
            0.003,
            "bridge amplifiers with 10 to 500 Hz bandwidth: 0.3 to 16 ms",
            description="It is the time constant of the filter in the torque channel.",
        ),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {"lag": FirstOrder(rate)}

    def transform(self, signals: Signals, values: Values, state: State) -> None:
        signals.torque = state["lag"].run(signals.torque, float(values["T"]))

    def response(self, frequency: np.ndarray, values: Values) -> np.ndarray:
        return 1.0 / (1.0 + 2j * np.pi * frequency * float(values["T"]))
