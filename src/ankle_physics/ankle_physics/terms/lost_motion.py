"""Lost motion in the drive: behind a reversal the plate follows the encoder only gradually.

A loose shaft, a worn gear or a soft coupling between encoder and plate gives way before it takes
the plate along, and friction holds it there. With the Dahl spring z (`DahlSpring`) that yields at
``gap``::

    x_plate = x_encoder - z / 2,    z' = v - |v| z / gap

Behind a reversal the plate stands still at first. It moves like the encoder once the movement is
much larger than the gap.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.memory_elements import DahlSpring
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values


class LostMotion(Term):
    """Models a plate that lags behind the encoder by half a gap, on the side that it came from.

    The rounded edge of the gap is that of the Dahl spring (Dahl 1968); play with sharp edges
    between plate and foot is the term `backlash`. Velocity and acceleration are the exact
    derivatives of the position, so that the plate's inertia is taken along, too.
    """

    name = "lost_motion"
    place = Place.ACTUATOR
    family = "backlash"
    separated_by = "slow triangular movements of several sizes"
    sentence = (
        "When the movement reverses, the drive turns a little before the plate follows: a loose "
        "or worn shaft behind the encoder."
    )
    parameters = (
        Parameter(
            "gap",
            "rad",
            1e-4,
            0.02,
            0.002,
            "by reasoning: from the noise of an encoder to a worn coupling of a degree",
            description="It is the angle that the plate loses from one reversal to the next.",
        ),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {"spring": DahlSpring(rate)}

    def transform(self, signals: Signals, values: Values, state: State) -> None:
        gap = float(values["gap"])
        v, a = signals.velocity, signals.acceleration
        z = state["spring"].run(signals.position, gap)
        # Share of the drive's movement, at each moment.
        lost = 0.5 * (1.0 - np.sign(v) * z / gap)
        signals.move_plate(
            signals.position - 0.5 * z,
            v * (1.0 - lost),
            a * (1.0 - lost) + lost * np.abs(v) * v / gap,
        )
