"""Vibration of footplate and torque sensor: ``Tm'' + 2 z w Tm' + w^2 Tm = w^2 T``."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ankle_physics.linear_dynamics import SecondOrder
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values


class TorqueSensorMode(Term):
    """Models the plate on the elastic torque sensor: a resonator between the joint's torque and the
    reading. By reasoning: an inertia on a spring and a damper has this equation.
    """

    name = "torque_sensor_mode"
    place = Place.TORQUE_SENSOR
    family = "resonance in the load path"
    separated_by = "fast pulses with the foot out of the plate"
    sentence = (
        "After each movement the torque reading rings: the rig or its torque sensor vibrates."
    )
    rings = True
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "frequency",
            "Hz",
            8.0,
            150.0,
            30.0,
            "sensors and footplates of ankle rigs: 20 to 200 Hz; what lies above the recorded "
            "band cannot be seen",
            description="It is the natural frequency of the vibration.",
            # A light vibration is found from within a fifth of its frequency.
            tried=(10.0, 15.0, 23.0, 34.0, 52.0, 80.0, 121.0),
        ),
        Parameter(
            "damping",
            "1",
            0.01,
            1.0,
            0.1,
            "metal structures 0.01 to 0.05, with a foot strapped on up to 0.3; the filter of a "
            "torque amplifier 0.5 to 1",
            description="It is the damping ratio of the vibration.",
            tried=(0.03, 0.1, 0.3),
        ),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {"mode": SecondOrder(rate)}

    def transform(self, signals: Signals, values: Values, state: State) -> None:
        omega = 2.0 * np.pi * float(values["frequency"])
        signals.torque = state["mode"].run(signals.torque, omega, float(values["damping"]))

    def response(self, frequency: np.ndarray, values: Values) -> np.ndarray:
        ratio = frequency / float(values["frequency"])
        return 1.0 / (1.0 - ratio**2 + 2j * float(values["damping"]) * ratio)
