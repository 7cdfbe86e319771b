"""Vibration of a sensor that carries a part of the load.

``Tm = (1 - share) T + share * Tv``, ``Tv'' + 2 z w Tv' + w^2 Tv = w^2 T``.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Values
from ankle_physics.terms.torque_sensor_mode import TorqueSensorMode


class PartialSensorMode(TorqueSensorMode):
    """Models a load that reaches the reading on two ways, of which one vibrates.

    Of a foot on two force cells, or a plate with a stiff and an elastic bearing, a share of the
    torque passes the elastic part; `torque_sensor_mode` is the case in which all of it does. By
    reasoning: two parallel ways of the load add up, and each keeps its share.
    """

    name = "partial_sensor_mode"
    place = Place.TORQUE_SENSOR
    family = "resonance in the load path"
    separated_by = "fast pulses with the foot out of the plate"
    generalises = ("torque_sensor_mode",)
    sentence = (
        "After each movement a part of the torque reading rings: one of several sensors or "
        "bearings vibrates."
    )
    parameters = (
        *TorqueSensorMode.parameters,
        Parameter(
            "share",
            "1",
            0.02,
            0.98,
            0.5,
            "by reasoning: beyond these one of the two ways carries nothing",
            description=(
                "It is the share of the torque that passes through the sensor that vibrates."
            ),
            tried=(0.1, 0.4, 0.8),
        ),
    )

    def transform(self, signals: Signals, values: Values, state: State) -> None:
        share = float(values["share"])
        direct = signals.torque
        super().transform(signals, values, state)
        signals.torque = (1.0 - share) * direct + share * signals.torque

    def response(self, frequency: np.ndarray, values: Values) -> np.ndarray:
        share = float(values["share"])
        return 1.0 - share + share * super().response(frequency, values)
