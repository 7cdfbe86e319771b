"""Friction with presliding (Dahl): ``torque = F * z / slide``, ``z' = v - |v| z / slide``."""

from __future__ import annotations

import numpy as np

from ankle_physics.memory_elements import DahlSpring
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values


class DahlHysteresis(Term):
    """Models rate-independent hysteresis: a bristle that bends over `slide` and then slips with the
    torque F.

    Dahl 1968 (Aerospace Report TOR-0158(3107-18)-1); the rate-independent part of the LuGre model
    (Canudas de Wit et al. 1995, IEEE Trans. Autom. Control 40, 419). It keeps its torque at rest.
    """

    name = "dahl_hysteresis"
    place = Place.INTRINSIC
    family = "intrinsic memory"
    separated_by = "slow triangular movements of several sizes"
    has_memory = True
    sentence = (
        "Going there and coming back meet different torques, however slow the movement: "
        "friction that bends before it slips."
    )
    parameters = (
        Parameter(
            "F",
            "N.m",
            0.0,
            10.0,
            0.5,
            "passive ankle hysteresis 0.3 to 2 N.m; bearings and seals of a rig below 2 N.m",
            description="It is the torque at which the contact slips.",
            linear=True,
        ),
        Parameter(
            "slide",
            "rad",
            0.0002,
            0.05,
            0.005,
            "presliding of seals and skin: fractions of a degree",
            description="It is the angle over which the contact bends before it slips.",
        ),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {"spring": DahlSpring(rate)}

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        slide = float(values["slide"])
        return {"F": state["spring"].run(signals.foot_position, slide) / slide}
