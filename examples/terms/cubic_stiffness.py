"""Stiffness that grows with the square of the deflection: ``torque = k3 * x**3``."""

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values


class CubicStiffness(Term):
    """Models torque that grows with the cube of the foot's angle: ``torque = k3 * x**3``."""

    name = "cubic_stiffness"
    place = Place.INTRINSIC
    sentence = "The joint becomes stiffer towards both ends of its range."
    parameters = (
        Parameter(
            "k3",
            "N.m/rad^3",
            0.0,
            1e5,
            2000.0,
            "chosen for this example",
            description="It is the torque at an angle of 1 rad.",
            linear=True,
        ),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        """Return the column that the parameter multiplies."""
        return {"k3": signals.foot_position**3}
