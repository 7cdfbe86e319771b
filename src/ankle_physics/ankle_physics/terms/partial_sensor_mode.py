"""Vibration of a sensor that carries a part of the load.

``Tm = (1 - share) T + share * Tv``, ``Tv'' + 2 z w Tv' + w^2 Tv = w^2 T``.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.linear_dynamics import SecondOrder
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values


class PartialSensorMode(Term):
    """The load reaches the reading on two ways, and one of them vibrates.

    Of a foot on two force cells, or a plate with a stiff and an elastic bearing, a share of the
    torque passes the elastic part; `torque_sensor_mode` is the case in which all of it does.
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
        Parameter(
            "frequency",
            "Hz",
            8.0,
            150.0,
            30.0,
            "sensors and footplates of ankle rigs: 20 to 200 Hz; what lies above the recorded "
            "band cannot be seen",
        ),
        Parameter(
            "damping",
            "1",
            0.01,
            0.9,
            0.1,
            "metal structures 0.01 to 0.05, with a foot strapped on up to 0.3",
        ),
        Parameter(
            "share",
            "1",
            0.02,
            0.98,
            0.5,
            "by reasoning: beyond these one of the two ways carries nothing",
        ),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {"mode": SecondOrder(rate)}

    def transform(self, signals: Signals, values: Values, state: State) -> None:
        omega = 2.0 * np.pi * float(values["frequency"])
        share = float(values["share"])
        ringing = state["mode"].run(signals.torque, omega, float(values["damping"]))
        signals.torque = (1.0 - share) * signals.torque + share * ringing

    def response(self, frequency: np.ndarray, values: Values) -> np.ndarray:
        ratio = frequency / float(values["frequency"])
        share = float(values["share"])
        mode = 1.0 / (1.0 - ratio**2 + 2j * float(values["damping"]) * ratio)
        return 1.0 - share + share * mode
