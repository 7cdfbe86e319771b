"""Tendon in series with the spindles: ``T * drive' + drive = v``."""

from __future__ import annotations

from ankle_physics.linear_dynamics import FirstOrder
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values


class Tendon(Term):
    """Models that the muscle's stretch lags behind the joint's while the tendon gives way; T is its
    compliance times the muscle's viscosity (Loram, Maganaris & Lakie 2007).
    """

    name = "tendon"
    place = Place.REFLEX_INPUT
    family = "reflex lag"
    separated_by = "EMG of the calf beside torque"
    sentence = "The tendon gives way first, so the spindles feel a slower, later stretch."
    parameters = (
        Parameter(
            "T",
            "s",
            0.002,
            0.2,
            0.02,
            "muscle viscosity over tendon stiffness, some milliseconds to a tenth of a second",
            description=(
                "It is the time constant with which the muscle's stretch follows the joint."
            ),
        ),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {"lag": FirstOrder(rate)}

    def transform(self, signals: Signals, values: Values, state: State) -> None:
        signals.drive = state["lag"].run(signals.drive, float(values["T"]))
