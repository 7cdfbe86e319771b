"""Fixation in which the foot strikes stops: the edges of the plate, a rigid shell, a taut strap.

``torque = k_s e + k_stop (e - clip(e, -gap, gap)) + b_s * extension rate``, e the extension.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.term import Parameter, Place, Values
from ankle_physics.terms.fixation_compliance import FixationCompliance


class FixationStops(FixationCompliance):
    """Models straps that let the foot move on the plate as far as stops on both sides.

    Between the stops the straps alone hold it. The stops lie about the extension under the mean
    load of the recording, where the foot was strapped in. By reasoning: a stop adds its stiffness
    to that of the straps (`fixation_compliance`) where the foot touches it.
    """

    name = "fixation_stops"
    place = Place.COUPLING
    family = "resonance in the load path"
    separated_by = "steps of several sizes about several mean torques"
    generalises = ("fixation_compliance",)
    usual = False
    linear = False
    sentence = (
        "The straps and the sole give way until the foot strikes a stop, from where on it hardly "
        "moves against the footplate."
    )
    parameters = (
        *FixationCompliance.parameters,
        Parameter(
            "gap",
            "rad",
            0.0003,
            0.03,
            0.003,
            "a millimetre at a lever of 0.1 m is 0.01 rad; smaller ones are below an encoder's "
            "resolution",
            tried=(0.0007, 0.002, 0.006),
            description="It is the extension on either side at which the foot strikes a stop.",
        ),
        Parameter(
            "k_stop",
            "N.m/rad",
            300.0,
            100000.0,
            5000.0,
            "by reasoning: from as stiff as soft straps to rigid",
            tried=(5000.0,),
            description="It is the stiffness of the stops, beside that of the straps.",
        ),
    )

    def coupling_torque(
        self, extension: np.ndarray, rate: np.ndarray, values: Values
    ) -> np.ndarray:
        gap = float(values["gap"])
        beyond = extension - np.clip(extension, -gap, gap)
        return super().coupling_torque(extension, rate, values) + values["k_stop"] * beyond
