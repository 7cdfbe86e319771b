"""Stiffness changes with the angle.

``torque = k1 * (x - xc)^2 / 2``, so that ``dK/dx = k1``.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.operating_parameters import operating_angle
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Turn, Values

# Over a movement of 0.05 rad the stiffness changes by 1000 N.m/rad at this slope, which is more
# than ankles have at any contraction of a seated subject.
STEEPEST = 2e4  # N.m/rad^2

STIFFNESS_SLOPE = Parameter(
    "k1",
    "N.m/rad^2",
    -STEEPEST,
    STEEPEST,
    300.0,
    "Weiss et al. 1986: stiffness doubles over 0.2 rad; more over small steps",
    description="It says how much the stiffness grows for each radian of dorsiflexion.",
    linear=True,
)


class PositionDependentStiffness(Term):
    """Models even curvature of the static torque-angle curve; K is the stiffness at the angle xc.

    Passive ankle torque grows about exponentially towards dorsiflexion (Weiss, Kearney & Hunter
    1986, J. Biomech. 19, 727: stiffness doubles to triples over 0.2 to 0.3 rad).
    """

    name = "position_dependent_stiffness"
    place = Place.INTRINSIC
    family = "static curve"
    separated_by = "steps about several mean positions"
    sentence = "Stiffness changes with the angle of the foot."
    turn = Turn(
        "k1",
        0.0,
        "The joint is stiffer the further the foot is down.",
        "The joint is stiffer the further the foot is up.",
    )
    parameters = (
        STIFFNESS_SLOPE,
        operating_angle("It is the angle at which K is stated."),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        return {"k1": 0.5 * (signals.foot_position - values["xc"]) ** 2}
