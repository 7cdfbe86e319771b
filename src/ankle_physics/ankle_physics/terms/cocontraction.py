"""Stiffness that calf and shin muscles add together: ``torque = kc n(t) (x - xc)``."""

from __future__ import annotations

import numpy as np

from ankle_physics.operating_parameters import operating_angle
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values


class Cocontraction(Term):
    """Models that opposing muscles contract together, now more and now less: the stiffness rises
    and falls, and the torque that the ankle holds hardly tells.

    n has a mean of 0 and a root mean square of 1, so that K is the mean over the recording. A
    diagnosis reads n from the stiffness that each stretch of a recording shows
    (`model_discrepancy.fit.stiffness_course`). In a simulation it is 0 unless it is given; a
    scenario changes K itself.

    Milner et al. 1995 (Exp. Brain Res. 107, 293): stiffness grows with co-contraction beyond what
    the net torque explains.
    """

    name = "cocontraction"
    place = Place.INTRINSIC
    family = "joint follows activation or time"
    separated_by = "EMG of calf and shin muscles"
    # Its torque depends on when, and not on the angle alone: no part of the tangent stiffness.
    has_memory = True
    generalises = (
        "stiffness_drift",
        "settling_stiffness",
        "cyclic_stiffness",
        "activation_stiffness",
    )
    sentence = "Stiffness rises and falls with a contraction that the torque does not show."
    parameters = (
        Parameter(
            "kc",
            "N.m/rad",
            0.0,
            500.0,
            15.0,
            "as cyclic_stiffness: up to a few times the smallest stiffness",
            description="It is the root mean square of the change of stiffness that is known.",
            linear=True,
        ),
        operating_angle("It is the angle about which the spring acts."),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        return {"kc": signals.cocontraction * (signals.foot_position - values["xc"])}
