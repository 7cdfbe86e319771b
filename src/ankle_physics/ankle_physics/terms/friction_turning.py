"""How dry friction turns: ``torque = sum over k of F_k * (d(v_k, T_k) - d(0.01 rad/s, 0))`` with
the direction ``d(v_k, T_k) = tanh((v + T_k * a) / v_k)`` of the plate's movement.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import Owner, Parameter, Place, State, Term, Values
from ankle_physics.terms.coulomb_friction import direction, steepness

# Speed within which a bearing usually turns [rad/s], with the velocity. It is subtracted from the
# others, which so change how the friction turns, and not its size.
_SUBTRACTED = 0.01, 0.0
# Sharper, more gradual, sooner and later. Of twelve sets of two to fourteen such turnings it is the
# one with which K was nearest to the truth (within 1.5 %) in four recordings of an independent rig
# with a command and eight simulated ones; with fourteen K was up to 3.3 % too high.
_OTHERS = {
    "F_sharp": (0.004, 0.0),
    "F_sharp_late": (0.004, -0.0015),
    "F_sharp_early": (0.004, 0.0015),
    "F_late": (0.01, -0.0015),
    "F_early": (0.01, 0.0015),
    "F_gradual": (0.03, 0.0),
}
_ROUNDING, _LEAD = (
    np.array(column)[:, np.newaxis] for column in zip(*_OTHERS.values(), strict=True)
)


def _when(lead: float) -> str:
    if lead == 0.0:
        return "with the velocity"
    return f"{abs(1000.0 * lead):g} ms {'before' if lead > 0.0 else 'after'} the velocity does"


class FrictionTurning(Term):
    """Frees how friction turns where a movement begins or ends, beside a term of friction.

    Every bearing turns in another way within milliseconds, sooner than the low-pass of a recording
    lets the movement be known. Friction that turns more sharply or gradually, sooner or later
    describes that without naming it. A search does not look for it: it comes with
    `coulomb_friction` and `footplate_friction`.
    """

    name = "friction_turning"
    place = Place.COUPLING
    belongs_to = Owner.RIG
    searched = False
    sentence = "Where the movement begins or ends, the friction turns in a way of its own."
    parameters = tuple(
        Parameter(
            symbol,
            "N.m",
            -10.0,
            10.0,
            0.0,
            "of the order of the friction",
            description=f"It is the torque of friction that turns within {speed:g} rad/s, "
            f"{_when(lead)}.",
            linear=True,
        )
        for symbol, (speed, lead) in _OTHERS.items()
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        directions = direction(signals, _ROUNDING, _LEAD) - direction(signals, *_SUBTRACTED)
        return dict(zip(_OTHERS, directions, strict=True))

    @classmethod
    def drag(cls, values: Values, velocity: float) -> float:
        usual = steepness(velocity, _SUBTRACTED[0])
        return sum(
            float(np.ravel(values[symbol])[0]) * (steepness(velocity, speed) - usual)
            for symbol, (speed, _) in _OTHERS.items()
        )
