"""Uneven angle: the plate's angle differs from the measured one by a smooth curve of the angle.

A potentiometer, an encoder scale or a gear that is not even over its range. With the cubic
B-splines S of `angle_spline` over the range of the recording::

    x_plate = x + sum_k c_k S((x - xc) / spacing - k)

where x is the measured angle and c are the values e_k without their straight line: an error of a
constant slope would be a wrong gain, which nothing but a second sensor shows.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ankle_physics.angle_spline import KNOTS, curve_of_angle, without_polynomial
from ankle_physics.operating_parameters import operating_angle, operating_span
from ankle_physics.signals import Signals
from ankle_physics.term import Place, State, Term, Values
from ankle_physics.terms.cyclic_angle_error import CyclicAngleError

_WITHOUT_LINE = without_polynomial(1)


class UnevenAngle(Term):
    """Models a plate whose angle differs from the measured one by a curve of the angle.

    Velocity and acceleration are the exact derivatives of the plate's position. Beyond the span of
    the recording the error fades. Beside it, `cyclic_angle_error` may hold what repeats within a
    few knots. By reasoning: a smooth curve can be written in splines, whatever made it.
    """

    name = "uneven_angle"
    place = Place.ACTUATOR
    family = CyclicAngleError.family
    separated_by = CyclicAngleError.separated_by
    searched = False
    flexible = True
    sentence = (
        "The measured angle is wrong by an amount that changes as the plate turns: an uneven "
        "potentiometer, encoder scale or gear."
    )
    parameters = (
        *(
            replace(
                CyclicAngleError.parameter("s"),
                symbol=f"e{number}",
                default=0.0,
                tried=(),
                description=f"It is the size of the error about knot {number} of {KNOTS}.",
            )
            for number in range(1, KNOTS + 1)
        ),
        operating_span("It is the range of angles over which the knots are spread evenly."),
        operating_angle("It is the angle of the knot in the middle."),
    )

    def transform(self, signals: Signals, values: Values, state: State) -> None:
        sizes = np.array([float(values[f"e{number}"]) for number in range(1, KNOTS + 1)])
        error, slope, bend = curve_of_angle(
            signals.position,
            float(values["xc"]),
            float(values["span"]),
            _WITHOUT_LINE @ sizes,
            derivatives=2,
        )
        v, a = signals.velocity, signals.acceleration
        signals.move_plate(
            signals.position + error, v * (1.0 + slope), a * (1.0 + slope) + bend * v**2
        )
