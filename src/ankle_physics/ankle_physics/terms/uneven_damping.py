"""Uneven damping: the torque per velocity changes with the angle, by any smooth curve.

``torque = sum_k b_k D_k(x) v``, where D_k is the cubic B-spline about knot k (`angle_spline`), less
the mean of all: what does not change with the angle is viscosity.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.angle_spline import KNOTS, curve_of_angle, without_polynomial
from ankle_physics.operating_parameters import operating_angle, operating_span
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values

_WITHOUT_MEAN = without_polynomial(0)


class UnevenDamping(Term):
    """Models tissue or a bearing that resists more at some angles than at others.

    A curve of the angle with a knot for each twelfth of the recording's range. By reasoning: a
    smooth curve can be written in splines, whatever made it.
    """

    name = "uneven_damping"
    place = Place.INTRINSIC
    family = "damping by angle"
    separated_by = "movements of one speed about several angles"
    searched = False
    flexible = True
    sentence = (
        "The damping changes as the joint turns: tissue or a bearing resists more at some angles "
        "than at others."
    )
    parameters = (
        *(
            Parameter(
                f"b{number}",
                "N.m.s/rad",
                -5.0,
                5.0,
                0.0,
                "by reasoning: a change as large as the largest viscosity of a relaxed ankle",
                description=f"It is what the damping about knot {number} of {KNOTS} differs by.",
                linear=True,
            )
            for number in range(1, KNOTS + 1)
        ),
        operating_span("It is the range of angles over which the knots are spread evenly."),
        operating_angle("It is the angle of the knot in the middle."),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        (splines,) = curve_of_angle(
            signals.foot_position, float(values["xc"]), float(values["span"]), _WITHOUT_MEAN
        )
        columns = splines.T * signals.foot_velocity
        return {f"b{number}": column for number, column in enumerate(columns, start=1)}
