"""Stress relaxation: a spring in series with a dashpot, ``T * torque' + torque = k * T * v``."""

from __future__ import annotations

import numpy as np

from ankle_physics.linear_dynamics import FirstOrder
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values


class MaxwellRelaxation(Term):
    """Models extra stiffness that relaxes with the time constant T: ``torque = k * (x - x lagged by
    T)``.

    Beside stiffness and viscosity this is the standard linear solid of muscle and tendon (Fung,
    Biomechanics, 1993, section 2.11).
    """

    name = "maxwell_relaxation"
    place = Place.INTRINSIC
    family = "intrinsic memory"
    separated_by = "steps of several sizes held for two seconds and more"
    has_memory = True
    sentence = "After a movement the torque relaxes: tissues give way while the angle is held."
    parameters = (
        Parameter(
            "k",
            "N.m/rad",
            0.0,
            10_000.0,
            30.0,
            "passive ankles relax by 10 to 30 % of their stiffness; a tendon in series with a "
            "viscous muscle has its own, some thousands (Loram & Lakie 2002)",
            description=(
                "It is the stiffness of the spring, which fast movements meet and slow ones do not."
            ),
            linear=True,
        ),
        Parameter(
            "T",
            "s",
            0.001,
            2.0,
            0.1,
            "cross-bridge and tissue relaxation, milliseconds to seconds (Kirsch & Kearney 1997)",
            description="It is the time constant with which the torque of the spring dies away.",
        ),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {"lag": FirstOrder(rate)}

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        x = signals.foot_position
        return {"k": x - state["lag"].run(x, float(values["T"]))}
