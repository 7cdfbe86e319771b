"""Backlash between footplate and foot: the foot stays put while the plate crosses the gap."""

from __future__ import annotations

import numpy as np

from ankle_physics.memory_elements import BacklashOperator
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values


class Backlash(Term):
    """Models a foot that follows the backlash operator of the plate's position; it moves only while
    it is in touch. Its acceleration is the plate's while in touch: the impact itself is shorter
    than the band that is measured.

    Models of backlash are compared by Nordin & Gutman 2002 (Automatica 38, 1633).
    """

    name = "backlash"
    place = Place.COUPLING
    family = "backlash"
    separated_by = "slow triangular movements of several sizes"
    sentence = (
        "When the movement reverses the plate crosses a gap before it takes the foot "
        "along: a loose fixation."
    )
    parameters = (
        Parameter(
            "gap",
            "rad",
            0.0,
            0.03,
            0.003,
            "loose straps and worn joints: up to a degree",
            description="It is the angle that the plate crosses before it takes the foot along.",
            # A search that begins at a much larger gap describes a small one worse than none.
            tried=(0.0003, 0.0008, 0.002, 0.004, 0.008, 0.016),
        ),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {"operator": BacklashOperator(), "last": None}

    def transform(self, signals: Signals, values: Values, state: State) -> None:
        foot = state["operator"].run(signals.position, float(values["gap"]))
        before = foot[:1] if state["last"] is None else state["last"]
        state["last"] = foot[-1:] if len(foot) else before
        moving = np.diff(foot, prepend=before) != 0.0
        signals.move_foot(foot, signals.velocity * moving, signals.acceleration * moving)
