"""Short-range stiffness of many bonds that yield one after the other (Iwan, Prandtl-Ishlinskii).

``torque = sum_i k_i * z_i``, ``z_i' = v - z_i / recovery``, ``-yield_i <= z_i <= yield_i``.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.memory_elements import YieldingSpring
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values
from ankle_physics.terms.short_range_stiffness import ShortRangeStiffness

# Each yield is three times the one before: from the position noise of the recorded human trials
# (0.1 mrad) times ten, to the steps of a laboratory (30 mrad). Between neighbours the sum follows
# any smooth distribution of yields within 7 % of its largest torque.
YIELDS = (0.001, 0.003, 0.009, 0.027)
_SOURCE = (
    "Loram et al. 2007: the ankle is several times stiffer below 7 mrad; the share of each size "
    "is what a recording tells"
)


class DistributedShortRangeStiffness(Term):
    """Models cross-bridges and tissues of different reach, which hold and let go at different
    extensions.

    A parallel arrangement of springs that slip at different sizes (Iwan 1966, J. Appl. Mech. 33,
    893) with recovery at rest. Its stiffness falls gradually with the size of the movement, where
    one yield alone (`short_range_stiffness`) falls at that size.
    """

    name = "distributed_short_range_stiffness"
    place = Place.INTRINSIC
    family = "intrinsic memory"
    separated_by = "slow triangular movements of several sizes"
    generalises = ("short_range_stiffness",)
    has_memory = True
    sentence = (
        "The muscle is the stiffer the smaller the movement: bonds of different reach let go one "
        "after the other."
    )
    parameters = (
        *(
            Parameter(
                f"k{number}",
                "N.m/rad",
                0.0,
                2000.0,
                15.0,
                _SOURCE,
                description=f"It is the stiffness of the bonds that let go at {size:g} rad.",
                linear=True,
            )
            for number, size in enumerate(YIELDS, start=1)
        ),
        ShortRangeStiffness.parameter("recovery"),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {"springs": [YieldingSpring(rate) for _ in YIELDS]}

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        recovery = float(values["recovery"])
        return {
            f"k{number}": spring.run(signals.foot_position, size, recovery)
            for number, (spring, size) in enumerate(
                zip(state["springs"], YIELDS, strict=True), start=1
            )
        }
