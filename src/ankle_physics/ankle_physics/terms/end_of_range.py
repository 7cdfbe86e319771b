"""Further stiffness beyond an angle: ``torque = ke * toe * ln(1 + exp((x - xc - xe) / toe))``."""

from __future__ import annotations

import numpy as np

from ankle_physics.operating_parameters import operating_angle
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Turn, Values

# As stiff as an ankle that a seated subject contracts as far as it can, and more than joints show
# near the end of their range.
STIFFEST_END = 800.0  # N.m/rad


class EndOfRange(Term):
    """Models ligaments, tendons and fascia that are slack within a range of angles and taut beyond
    it, as near the end of the joint's range of motion (Riener & Edrich 1999, J. Biomech. 32, 539).

    Collagen is stretched straight before it is taut (its toe region), so that the stiffness rises
    over some width; the torque is ``ke * max(x - xc - xe, 0)``, rounded over the width ``toe``.
    With ke < 0 the joint is stiffer below the angle than above it, as near the other end.
    """

    name = "end_of_range"
    place = Place.INTRINSIC
    family = "static curve"
    # With a wide toe about the middle of the movement the stiffness rises evenly.
    generalises = ("position_dependent_stiffness",)
    separated_by = "steps about several mean positions"
    sentence = "From a certain angle on the joint has another stiffness."
    turn = Turn(
        "ke",
        0.0,
        "Beyond a certain angle downwards the joint meets a further stiffness, as at the end of "
        "its range.",
        "Beyond a certain angle upwards the joint meets a further stiffness, as at the end of its "
        "range.",
    )
    parameters = (
        Parameter(
            "ke",
            "N.m/rad",
            -STIFFEST_END,
            STIFFEST_END,
            60.0,
            "a joint near the end of its range is several times as stiff as in the middle",
            description="It is the stiffness beyond the angle that the joint has not before it.",
            linear=True,
        ),
        Parameter(
            "xe",
            "rad",
            -0.2,
            0.2,
            0.01,
            "an angle further from the mean one is outside the movements of a recording",
            description="It is the angle, counted from xc, at which the stiffness changes.",
            tried=(-0.02, -0.01, 0.0, 0.01, 0.02),
        ),
        Parameter(
            "toe",
            "rad",
            2e-4,
            0.03,
            2e-3,
            "collagen is straight after a strain of 2 % (Fratzl et al. 1998, J. Struct. Biol. 122, "
            "119): 2 mm of a fascicle of 60 mm, some hundredths of a radian, or part of it",
            description="It is the width of the angle over which the stiffness rises.",
            tried=(2e-3,),
        ),
        operating_angle("It is the angle from which xe is counted."),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        beyond = signals.foot_position - values["xc"] - values["xe"]
        toe = values["toe"]
        return {"ke": toe * np.logaddexp(0.0, beyond / toe)}
