"""Short-range stiffness with yield and recovery: ``torque = k * z``, ``z' = v - z / recovery``,
``-yield <= z <= yield``.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.memory_elements import YieldingSpring
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values


class ShortRangeStiffness(Term):
    """Models attached cross-bridges, which are stiff until they are pulled off; new ones attach
    while the muscle rests.

    Rack & Westbury 1974 (J. Physiol. 240, 331); for the ankle Loram, Maganaris & Lakie 2007
    (J. Physiol. 584, 661): stiffness is several times higher below 0.4 degrees (7 mrad). The
    stiffness is the same up to the yield, as Rack & Westbury measured it; in recorded human ankles
    this leaves less error than a stiffness that falls gradually (`DahlSpring`).
    """

    name = "short_range_stiffness"
    place = Place.INTRINSIC
    family = "intrinsic memory"
    separated_by = "slow triangular movements of several sizes"
    # Without a yield, the bonds that are forgotten are a Maxwell element.
    generalises = ("maxwell_relaxation",)
    has_memory = True
    sentence = (
        "Small movements meet a stiffer muscle than large ones: cross-bridges hold at "
        "first and then let go."
    )
    parameters = (
        Parameter(
            "k",
            "N.m/rad",
            0.0,
            2000.0,
            60.0,
            "Loram et al. 2007: up to several times the stiffness of larger movements",
            description="It is the stiffness of the bonds that hold.",
            linear=True,
        ),
        Parameter(
            "yield",
            "rad",
            0.0005,
            0.05,
            0.007,
            "Loram et al. 2007: 0.4 degrees; Rack & Westbury 1974: 0.3 mm of muscle",
            description="It is the angle by which the bonds are stretched before they let go.",
        ),
        Parameter(
            "recovery",
            "s",
            0.02,
            20.0,
            0.5,
            "cross-bridge reattachment 0.05 s, thixotropic recovery up to 10 s (Proske & Morgan "
            "1999)",
            description="It is the time constant with which new bonds attach.",
            limit_case="upper",
        ),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {"spring": YieldingSpring(rate)}

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        return {
            "k": state["spring"].run(
                signals.foot_position, float(values["yield"]), float(values["recovery"])
            )
        }
