"""Fixation that is softer where the foot lifts off the plate than where it is pressed on it.

``torque = f(e) - f(0) + b_s * extension rate``, ``f(e) = k_s max(e, lift) + k_lift min(e - lift,
0)``, e the extension.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.term import Parameter, Values
from ankle_physics.terms.fixation_compliance import FixationCompliance


class HeelLift(FixationCompliance):
    """Models a foot whose heel or ball lifts off the plate, where the straps alone hold it.

    On one side of the extension at which it lifts the plate presses on the sole, on the other one
    the straps pull. That extension is counted from the one under the mean load of the recording: a
    foot that is pressed on the plate by a background torque lifts later. By reasoning: contact of a
    sole with a plate is unilateral, as in Hunt & Crossley 1975 (J. Appl. Mech. 42, 440).
    """

    name = "heel_lift"
    separated_by = "steps of several sizes about several mean torques"
    generalises = ("fixation_compliance",)
    usual = False
    linear = False
    sentence = (
        "The foot lifts off the footplate in one direction, where the straps alone hold it and "
        "give way more than the sole does."
    )
    parameters = (
        *FixationCompliance.parameters,
        Parameter(
            "k_lift",
            "N.m/rad",
            20.0,
            50000.0,
            900.0,
            "by reasoning: from as soft as a relaxed ankle, where straps are loose, to as stiff as "
            "the sole",
            tried=(100.0, 400.0, 10000.0),
            description="It is the stiffness below the extension at which the foot lifts.",
        ),
        Parameter(
            "lift",
            "rad",
            -0.02,
            0.02,
            0.0,
            "a background torque of 10 N.m on a sole of 500 N.m/rad presses it by 0.02 rad",
            tried=(-0.002, 0.0, 0.002),
            description="It is the extension at which the foot lifts, from that under the mean "
            "load.",
        ),
    )

    def coupling_torque(
        self, extension: np.ndarray, rate: np.ndarray, values: Values
    ) -> np.ndarray:
        lift = float(values["lift"])
        softer = float(values["k_lift"]) - float(values["k_s"])
        beyond = np.minimum(extension - lift, 0.0) - min(-lift, 0.0)
        return super().coupling_torque(extension, rate, values) + softer * beyond
