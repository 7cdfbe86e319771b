"""Coulomb friction of the footplate: ``torque = F * tanh(v_plate / v0)``."""

from __future__ import annotations

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import Owner, Parameter, Place, State, Term, Values

# The same curve over a wider range of speeds is no dry friction: it is a damping that weakens with
# speed (`saturating_damping`), whose range begins here.
FASTEST_CHANGE = 0.05  # rad/s


class CoulombFriction(Term):
    """Models the dry friction of footplate bearings and seals; v0 rounds the jump at rest so that
    noise does not switch it.

    The torque sensor feels it in front of the straps: it follows the plate's velocity, not the
    foot's. Models of friction are compared by Armstrong-Hélouvry, Dupont & Canudas de Wit 1994
    (Automatica 30, 1083).
    """

    name = "coulomb_friction"
    place = Place.COUPLING
    belongs_to = Owner.RIG
    rest_torque = "F"
    family = "intrinsic memory"
    separated_by = "slow triangular movements of several sizes"
    sentence = "A constant torque opposes every movement, however fast: dry friction."
    parameters = (
        Parameter(
            "F",
            "N.m",
            0.0,
            10.0,
            0.5,
            "bearings and seals of ankle rigs: below 2 N.m",
            description="It is the torque with which friction opposes the movement of the plate.",
            linear=True,
        ),
        Parameter(
            "v0",
            "rad/s",
            0.003,
            FASTEST_CHANGE,
            0.03,
            "from a tenth of the velocity noise of the paper's encoder to a speed that most "
            "movements of an ankle exceed; beyond it, damping levels off",
            description=(
                "It is the speed within which the friction changes its direction gradually."
            ),
        ),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        return {"F": np.tanh(signals.velocity / float(values["v0"]))}
