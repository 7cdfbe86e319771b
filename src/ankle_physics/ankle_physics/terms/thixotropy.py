"""Stiffness that movement breaks and rest rebuilds: ``torque = k * z``, ``z' = s v - |v| z /
breaking``, s the intact share of bonds.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.memory_elements import Bonds
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values


class Thixotropy(Term):
    """Models bonds that movement breaks and rest rebuilds: ``s' = (1 - s)/recovery - |v| s /
    breaking`` (Lakie & Campbell 2019, J. Physiol. 597, 3445).

    New bonds form unstretched, wherever the muscle rests (Proske, Morgan & Gregory 1993, Prog.
    Neurobiol. 41, 705): rest makes no torque of its own, which a spring about one angle would.
    """

    name = "thixotropy"
    place = Place.INTRINSIC
    family = "intrinsic memory"
    separated_by = "movements after pauses from 0.2 to 5 s"
    has_memory = True
    sentence = "The joint is stiff after a rest and loosens while it is moved."
    parameters = (
        Parameter(
            "k",
            "N.m/rad",
            0.0,
            1000.0,
            40.0,
            "resting bonds: up to half of the passive stiffness (Lakie & Campbell 2019)",
            description="It is the stiffness of all bonds after a long rest.",
            linear=True,
        ),
        Parameter(
            "breaking",
            "rad",
            0.002,
            1.0,
            0.05,
            "movements of some degrees break most bonds",
            description="It is the movement that breaks most of the bonds.",
        ),
        Parameter(
            "recovery",
            "s",
            0.1,
            30.0,
            2.0,
            "Lakie & Campbell 2019: seconds to tens of seconds",
            description="It is the time constant with which rest rebuilds the bonds.",
        ),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {"bonds": Bonds(rate)}

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        return {
            "k": state["bonds"].run(
                signals.foot_position, float(values["breaking"]), float(values["recovery"])
            )
        }
