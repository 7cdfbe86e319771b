"""Uneven angle: the plate's angle differs from the measured one by a smooth curve of the angle.

A potentiometer, an encoder scale or a gear that is not even over its range. With cubic B-splines S
on knots that are spread evenly over the range of the recording::

    x_plate = x + sum_k c_k S((x - xc) / spacing - k),    spacing = span / (KNOTS - 1)

where x is the measured angle and c are the values e_k without their straight line: an error of a
constant slope would be a wrong gain, which nothing but a second sensor shows.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.interpolate import BSpline

from ankle_physics.operating_parameters import operating_angle, operating_span
from ankle_physics.signals import Signals
from ankle_physics.term import Place, State, Term, Values
from ankle_physics.terms.cyclic_angle_error import CyclicAngleError

# Over steps of up to 30 mrad to either side they are 5 mrad apart. On the recorded human trials
# knots 8 mrad apart take off three quarters as much on unseen rows, and closer ones no more.
KNOTS = 13
_DEGREE = 3


def _without_line() -> np.ndarray:
    """Return the matrix that takes the straight line out of values at the knots; splines with
    values on a straight line are that line.
    """
    line = np.column_stack([np.ones(KNOTS), np.arange(KNOTS)])
    return np.eye(KNOTS) - line @ np.linalg.pinv(line)


_WITHOUT_LINE = _without_line()


class UnevenAngle(Term):
    """Models a plate whose angle differs from the measured one by a curve of the angle.

    Velocity and acceleration are the exact derivatives of the plate's position. Beyond the span of
    the recording the error fades. Beside it, `cyclic_angle_error` may hold what repeats within a
    few knots.
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
        spacing = float(values["span"]) / (KNOTS - 1)
        # Knots without an error on both sides, so that the curve ends smoothly.
        pad = _DEGREE
        ends = np.arange(KNOTS + 3 * pad + 1) - 0.5 * (KNOTS - 1) - pad - 0.5 * (_DEGREE + 1)
        coefficients = np.pad(_WITHOUT_LINE @ sizes, pad)
        places = float(values["xc"]) + spacing * ends
        inside = np.clip(signals.position, places[pad], places[-pad - 1])
        curve = BSpline(places, coefficients, _DEGREE)
        error, slope, bend = (curve(inside, order) for order in range(3))
        v, a = signals.velocity, signals.acceleration
        signals.move_plate(
            signals.position + error, v * (1.0 + slope), a * (1.0 + slope) + bend * v**2
        )
