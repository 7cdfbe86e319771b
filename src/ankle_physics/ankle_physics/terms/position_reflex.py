"""Reflex to the size of the stretch: ``torque = Gp * w^2/(s^2 + 1.6 w s + w^2) * (x(t - delay) -
xc)``.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.linear_dynamics import Delay, SecondOrder
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values

# As the short-latency reflex of van 't Veld et al. 2018, section III-A: the muscle is of the same
# kind.
MUSCLE_DAMPING = 0.8


class PositionReflex(Term):
    """Tonic stretch reflex of length-sensitive (group II) afferents; it holds as long as the
    stretch does.
    """

    name = "position_reflex"
    place = Place.REFLEX_DYNAMICS
    family = "further reflex arc"
    separated_by = "steps that are held for one second and more"
    sentence = (
        "Reflex activity lasts as long as the stretch is held: it follows position, not only speed."
    )
    parameters = (
        Parameter(
            "Gp",
            "N.m/rad",
            0.0,
            500.0,
            20.0,
            "reflex share of the static stiffness: up to a half (Sinkjaer et al. 1988)",
            linear=True,
        ),
        Parameter(
            "delay",
            "s",
            0.03,
            0.15,
            0.06,
            "group II: 10 to 20 ms later than the short-latency reflex (Grey et al. 2001)",
        ),
        Parameter("omega", "rad/s", 5.0, 80.0, 21.0, "van 't Veld et al. 2018, section III-A"),
        Parameter(
            "xc",
            "rad",
            -1.0,
            1.0,
            0.0,
            "angle about which it is written; range of the ankle joint",
            fitted=False,
        ),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {
            "delay": Delay(rate, longest=self.parameter("delay").upper),
            "muscle": SecondOrder(rate),
        }

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        drive = signals.foot_position - values["xc"]
        delayed = state["delay"].run(drive, float(values["delay"]))
        return {"Gp": state["muscle"].run(delayed, float(values["omega"]), MUSCLE_DAMPING)}
