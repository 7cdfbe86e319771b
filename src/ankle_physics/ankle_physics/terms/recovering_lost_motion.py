"""Lost motion that comes back at rest: the plate stands still until the drive takes it along, and
settles towards the encoder while both are held.

A coupling that yields with friction, such as a soft boot or a worn clamp, gives way at the start of
a movement and creeps back afterwards. With the spring z of Bouc and Wen (`BoucWenSpring`), which
yields at half the gap::

    x_plate = x_encoder - z
    z' = v - z / recovery                         while |z| falls
    z' = v (1 - (2 z / gap)^2) - z / recovery     while |z| grows
"""

from __future__ import annotations

import numpy as np

from ankle_physics.memory_elements import BoucWenSpring
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values
from ankle_physics.terms.lost_motion import LostMotion


class RecoveringLostMotion(Term):
    """Models a plate that the drive takes along only once a gap is used up, also after a rest.

    The hysteresis of Bouc 1967 and Wen 1976 (J. Eng. Mech. Div. ASCE 102, 249) with equal shape
    factors and the exponent 2, and a recovery at rest. Velocity and acceleration are the exact
    derivatives of the position. The term `lost_motion` has no recovery and a softer edge.
    """

    name = "recovering_lost_motion"
    place = Place.ACTUATOR
    family = LostMotion.family
    separated_by = LostMotion.separated_by
    generalises = ("lost_motion",)
    searched = False
    flexible = True
    sentence = (
        "When a movement begins or reverses, the drive turns a little before the plate follows, "
        "and the plate settles back at rest: a coupling that yields behind the encoder."
    )
    parameters = (
        LostMotion.parameter("gap"),
        Parameter(
            "recovery",
            "s",
            0.02,
            20.0,
            0.3,
            "by reasoning: from the length of a movement to a third of a recording of a minute",
            description="It is the time constant with which the plate settles back at rest.",
        ),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {"spring": BoucWenSpring(rate)}

    def transform(self, signals: Signals, values: Values, state: State) -> None:
        limit, recovery = 0.5 * float(values["gap"]), float(values["recovery"])
        v, a = signals.velocity, signals.acceleration
        z = state["spring"].run(signals.position, limit, recovery)
        used = z / limit
        growing = z * v > 0.0
        # Share of the drive's movement that the spring takes up, and the spring's derivatives.
        taken = np.where(growing, 1.0 - used**2, 1.0)
        rate = v * taken - z / recovery
        taken_rate = np.where(growing, -2.0 * used * rate / limit, 0.0)
        signals.move_plate(
            signals.position - z,
            v - rate,
            a - (a * taken + v * taken_rate - rate / recovery),
        )
