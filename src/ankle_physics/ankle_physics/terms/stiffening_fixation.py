"""Fixation whose straps and soft tissue stiffen under load.

``torque = k_s * (exp(c * extension) - 1) / c + b_s * extension rate``, c the curvature.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.term import Parameter, Place, Turn, Values
from ankle_physics.terms.fixation_compliance import FixationCompliance

# Where the curve goes on straight, in units of 1 / curvature: three times as stiff or a third of it
# is as far as soft tissue was measured, and an exponential must not overflow.
_STRAIGHT_BEYOND = 1.1


class StiffeningFixation(FixationCompliance):
    """Models sole and straps whose stiffness rises in proportion to the torque that presses on
    them.

    Soft tissue in compression and webbing in tension follow an exponential (Fung, Biomechanics,
    1993, section 7.5). Seen from any load an exponential is one again, so that k_s is the stiffness
    under the mean load of the recording. c > 0: stiffer under dorsiflexing torque, which presses
    on the sole; c < 0: under plantarflexing torque, which pulls the straps.
    """

    name = "stiffening_fixation"
    place = Place.COUPLING
    family = "resonance in the load path"
    separated_by = "steps of several sizes about several mean torques"
    generalises = ("fixation_compliance",)
    linear = False
    sentence = "The straps and the sole give way, the less the harder they are pressed."
    turn = Turn(
        "curvature",
        0.0,
        "The straps and the sole give way, the less the harder the foot is pushed down.",
        "The straps and the sole give way, the less the harder the foot is pushed up.",
    )
    parameters = (
        *FixationCompliance.parameters,
        Parameter(
            "curvature",
            "1/rad",
            -300.0,
            300.0,
            60.0,
            "heel pads stiffen threefold over some millimetres, 0.02 rad at a lever of 0.1 m",
            description="It says how fast the stiffness grows with the extension of the straps.",
        ),
    )

    def coupling_torque(
        self, extension: np.ndarray, rate: np.ndarray, values: Values
    ) -> np.ndarray:
        curvature = float(values["curvature"])
        if curvature == 0.0:
            return super().coupling_torque(extension, rate, values)
        bent = curvature * extension
        near = np.clip(bent, -_STRAIGHT_BEYOND, _STRAIGHT_BEYOND)
        curve = np.expm1(near) + np.exp(near) * (bent - near)
        return values["k_s"] / curvature * curve + values["b_s"] * rate
