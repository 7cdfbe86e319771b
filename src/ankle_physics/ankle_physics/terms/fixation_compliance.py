"""Compliant fixation: the straps and the soft tissue under the foot give way, so the foot does not
follow the plate exactly.

``k_s (plate - foot) + b_s (plate' - foot') = sum of all torques on the foot``
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.term import Parameter, Place, Values


class FixationCompliance(CompliantCoupling):
    """Models a spring and a damper between footplate and foot; the torque sensor at the plate sees
    what they transmit.

    With the foot's inertia of 0.0137 kg.m^2 the fixation resonates at sqrt(k_s / I) / (2 pi): 24 Hz
    at 300 N.m/rad, 61 Hz at 2000, 192 Hz at 20000, where it is rigid for a 30 Hz actuator. The grip
    of a hand on a handle has the same equation in Schouten et al. 2008 (IEEE Trans. Biomed. Eng.
    55, 311).
    """

    name = "fixation_compliance"
    place = Place.COUPLING
    family = "resonance in the load path"
    separated_by = "fast pulses with the foot out of the plate"
    companions = ("footplate_inertia",)
    usual = True
    sentence = (
        "The straps and the sole give way, so that the foot moves less than the footplate "
        "and rings on it."
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "k_s",
            "N.m/rad",
            200.0,
            50000.0,
            2000.0,
            "van 't Veld et al. 2018, section III-B: Velcro straps, no stiffness given; range by "
            "reasoning: from as soft as the "
            "stiffest ankle simulated there (200 N.m/rad) to rigid at any frequency of interest",
            description="It is the stiffness of the straps and the sole between plate and foot.",
        ),
        Parameter(
            "b_s",
            "N.m.s/rad",
            0.1,
            100.0,
            2.0,
            "by reasoning: damping ratio 0.2 of the foot on 2000 N.m/rad, as soft tissue rings "
            "one or two periods",
            description="It is the viscosity of the straps and the sole between plate and foot.",
            limit_case="lower",
        ),
    )

    def linearised(self, values: Values) -> tuple[float, float]:
        return float(values["k_s"]), float(values["b_s"])

    def coupling_torque(
        self, extension: np.ndarray, rate: np.ndarray, values: Values
    ) -> np.ndarray:
        return values["k_s"] * extension + values["b_s"] * rate
