"""Stiffness and damping that follow muscle activation: ``torque = activation * (ka * (x - xc) + ba
* v)``.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.operating_angle import operating_angle
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Turn, Values


class ActivationStiffness(Term):
    """Models that intrinsic stiffness and viscosity grow with the background torque that the
    muscles hold; K and B are what is left at zero torque.

    Weiss, Hunter & Kearney 1988 (J. Biomech. 21, 539): stiffness rises linearly with torque, by 1
    to 8 N.m/rad per N.m.
    """

    name = "activation_stiffness"
    place = Place.INTRINSIC
    family = "joint follows activation or time"
    follows_torque = True
    separated_by = "holding at several torque levels"
    sentence = "Stiffness changes with the torque that the muscles hold."
    turn = Turn(
        "ka",
        0.0,
        "The joint is less stiff while the muscles hold more torque in dorsiflexion.",
        "The joint is stiffer while the muscles hold more torque.",
    )
    parameters = (
        Parameter(
            "ka",
            "1/rad",
            -30.0,
            30.0,
            4.0,
            "Weiss et al. 1988: 1 to 8 N.m/rad per N.m; negative: the flexors stiffen",
            description=(
                "It says how much the stiffness grows for each newton metre that the muscles hold."
            ),
            linear=True,
        ),
        Parameter(
            "ba",
            "s/rad",
            -0.5,
            0.5,
            0.0,
            "Weiss et al. 1988: the damping ratio is kept, so B rises too",
            description=(
                "It says how much the viscosity grows for each newton metre that the muscles hold."
            ),
            linear=True,
        ),
        operating_angle("It is the angle about which the spring acts."),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        activation = signals.activation
        return {
            "ka": activation * (signals.foot_position - values["xc"]),
            "ba": activation * signals.foot_velocity,
        }
