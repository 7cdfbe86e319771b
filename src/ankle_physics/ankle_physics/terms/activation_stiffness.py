"""Stiffness and damping that follow muscle activation: ``torque = (activation - Tc) * (ka * (x -
xc) + ba * v)``.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.operating_parameters import operating_angle, operating_torque
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Turn, Values


class ActivationStiffness(Term):
    """Models that intrinsic stiffness and viscosity grow with the background torque that the
    muscles hold; K and B of the model are those at the torque ``Tc``.

    Weiss, Hunter & Kearney 1988 (J. Biomech. 21, 539): stiffness rises linearly with torque, by 1
    to 8 N.m/rad per N.m. Written about a torque of the recording, it needs no stiffness at zero
    torque, which nobody measured.
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
            -200.0,
            200.0,
            4.0,
            "Weiss et al. 1988: 1 to 8 N.m/rad per N.m; more where calf and shin muscles contract "
            "together, which adds stiffness and little torque; negative: the flexors stiffen",
            description=(
                "It says how much the stiffness grows for each newton metre that the muscles hold."
            ),
            linear=True,
        ),
        Parameter(
            "ba",
            "s/rad",
            -2.0,
            2.0,
            0.0,
            "Weiss et al. 1988: the damping ratio is kept, so B rises too",
            description=(
                "It says how much the viscosity grows for each newton metre that the muscles hold."
            ),
            linear=True,
        ),
        operating_angle("It is the angle about which the spring acts."),
        operating_torque("It is the torque at which the joint has the stiffness of the model."),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        activation = signals.activation - values["Tc"]
        return {
            "ka": activation * (signals.foot_position - values["xc"]),
            "ba": activation * signals.foot_velocity,
        }
