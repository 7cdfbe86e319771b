"""Reflex gain that depends on the angle: ``torque = Gx * w^2/(s^2 + 1.6 w s + w^2) * (x - xc) *
max(drive, 0)``, delayed.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.linear_dynamics import Delay, SecondOrder
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Turn, Values

# As the short-latency reflex of van 't Veld et al. 2018, section III-A: the muscle is of the same
# kind.
MUSCLE_DAMPING = 0.8


class PositionReflexGain(Term):
    """A longer calf has a stronger reflex (Mirbagheri, Barbeau & Kearney 2000).

    The gain rises severalfold towards dorsiflexion (Exp. Brain Res. 135, 423).
    """

    name = "position_reflex_gain"
    place = Place.REFLEX_DYNAMICS
    family = "reflex gain by position"
    separated_by = "steps about several mean positions"
    sentence = "The reflex depends on the angle of the foot."
    turn = Turn(
        "Gx",
        0.0,
        "The reflex is weaker when the foot is further up.",
        "The reflex is stronger when the foot is further up.",
    )
    parameters = (
        Parameter(
            "Gx",
            "N.m.s/rad^2",
            -2000.0,
            2000.0,
            100.0,
            "Mirbagheri et al. 2000: G doubles over 0.1 to 0.2 rad; more within small steps",
            linear=True,
        ),
        Parameter("delay", "s", 0.025, 0.08, 0.04, "as the reflex: 35 to 50 ms"),
        Parameter("omega", "rad/s", 5.0, 80.0, 21.0, "van 't Veld et al. 2018, section III-A"),
        Parameter(
            "xc",
            "rad",
            -1.0,
            1.0,
            0.0,
            "angle at which G is stated; range of the ankle joint",
            fitted=False,
        ),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {
            "delay": Delay(rate, longest=self.parameter("delay").upper),
            "muscle": SecondOrder(rate),
        }

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        drive = (signals.foot_position - values["xc"]) * np.maximum(signals.drive, 0.0)
        delayed = state["delay"].run(drive, float(values["delay"]))
        return {"Gx": state["muscle"].run(delayed, float(values["omega"]), MUSCLE_DAMPING)}
