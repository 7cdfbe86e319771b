"""Angle error that repeats: the plate's angle differs from the measured one by a sine of the angle.

The gear between encoder and plate (transmission error), the scale of the encoder or the winding of
a potentiometer do not divide the angle evenly. With the period p of the error::

    x_plate = x + s sin(phi) + c cos(phi),    phi = 2 pi (x - xc) / p

where x is the measured angle. An error of a constant slope would be a wrong gain, which nothing but
a second sensor shows.
"""

from __future__ import annotations

import math

import numpy as np

from ankle_physics.operating_parameters import operating_angle
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values

_LARGEST_ERROR = 0.002


def _harmonic(symbol: str, default: float, meaning: str) -> Parameter:
    """Return the parameter of the sine or of the cosine [rad]."""
    return Parameter(
        symbol,
        "rad",
        -_LARGEST_ERROR,
        _LARGEST_ERROR,
        default,
        "by reasoning: a larger error (0.1 degrees) is seen by eye on a plot of angle against "
        "time; a strain wave gear has 0.3 mrad, a wound potentiometer up to 2 mrad within a turn",
        description=meaning,
        tried=(-2e-4, 2e-4),
    )


class CyclicAngleError(Term):
    """Models a plate whose angle differs from the measured one by an error with a period in the
    angle.

    Its first harmonic is modelled (kinematic error of strain wave gears: Tuttle & Seering 1996,
    IEEE Trans. Robot. Autom. 12, 368). Velocity and acceleration are the exact derivatives of the
    plate's position.
    """

    name = "cyclic_angle_error"
    place = Place.ACTUATOR
    family = "angle error"
    separated_by = "slow triangular movements beside a second angle sensor on the plate"
    sentence = (
        "The measured angle is wrong by an amount that repeats as the plate turns: an uneven gear, "
        "encoder scale or potentiometer."
    )
    parameters = (
        _harmonic("s", 3e-4, "It is the size of the error's sine about the angle xc."),
        _harmonic("c", 1e-4, "It is the size of the error's cosine about the angle xc."),
        Parameter(
            "p",
            "rad",
            0.012,
            0.1,
            0.03,
            "by reasoning: a shorter one is passed within a few samples of a perturbation of 1 to "
            "2 rad/s; a longer one looks like a gain to perturbations of some hundredths of a rad",
            description="It is the angle after which the error repeats.",
        ),
        operating_angle("It is the angle at which the sine of the error is zero."),
    )

    def transform(self, signals: Signals, values: Values, state: State) -> None:
        turn = 2.0 * math.pi / float(values["p"])
        phase = turn * (signals.position - float(values["xc"]))
        sine, cosine = np.sin(phase), np.cos(phase)
        s, c = float(values["s"]), float(values["c"])
        error = s * sine + c * cosine
        slope = turn * (s * cosine - c * sine)
        v, a = signals.velocity, signals.acceleration
        signals.move_plate(
            signals.position + error,
            v * (1.0 + slope),
            a * (1.0 + slope) - turn**2 * error * v**2,
        )
