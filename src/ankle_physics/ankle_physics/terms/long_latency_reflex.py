"""Later reflex response: ``torque = Gl * w^2/(s^2 + 1.6 w s + w^2) * max(drive(t - delay), 0)``."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ankle_physics.reflex_arc import MUSCLE_FREQUENCY, ReflexArc
from ankle_physics.signals import Signals
from ankle_physics.term import ModelValues, Parameter, Place, State, Values
from ankle_physics.terms.reflex import Reflex

# Where it is not in a model, the response of the short-latency reflex is drawn out to cover it:
# natural frequency and damping of 0.6 to 0.8 and 1.2 to 1.6 times what they are beside it, in four
# simulated ankles. A fit begins with their inverse.
FASTER = 1.4
LESS_DAMPED = 0.7
# Times at which a late response may begin [s] (Grey et al. 2001): medium latency, transcortical.
LATE_DELAYS = (0.075, 0.095, 0.12)


class LongLatencyReflex(ReflexArc):
    """Models medium- and long-latency components of the stretch reflex (Grey et al. 2001).

    They come after 60 to 80 ms, transcortical ones after 90 to 120 ms (J. Physiol. 534, 925).
    """

    name = "long_latency_reflex"
    place = Place.REFLEX_DYNAMICS
    family = "further reflex arc"
    separated_by = "EMG of the calf beside torque"
    sentence = "A second, later reflex follows the first one."
    parameters = (
        Parameter(
            "Gl",
            "N.m.s/rad",
            0.0,
            100.0,
            3.0,
            "up to the size of the short-latency reflex",
            description=(
                "It is the gain from the speed of the stretch to the torque of the later reflex."
            ),
            linear=True,
        ),
        Parameter(
            "delay",
            "s",
            0.06,
            0.2,
            0.095,
            "Grey et al. 2001: group II 60 to 80 ms; transcortical 90 to 120 ms, plus voluntary "
            "reaction from 150 ms",
            description=(
                "It is the time from the stretch to the first activity of the later reflex."
            ),
        ),
        MUSCLE_FREQUENCY,
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        drive = np.maximum(signals.drive, 0.0)
        return {"Gl": self.response_to(drive, values, state)}

    @classmethod
    def begins_beside(cls, model: Mapping[str, Values]) -> list[ModelValues]:
        if "reflex" not in model:
            return []
        drawn_out = {symbol: float(value) for symbol, value in model["reflex"].items()}
        reflex = drawn_out | {
            "omega": min(FASTER * drawn_out["omega"], Reflex.parameter("omega").upper),
            "z": max(LESS_DAMPED * drawn_out["z"], Reflex.parameter("z").lower),
        }
        own = {p.symbol: p.default for p in cls.parameters}
        return [
            {"reflex": reflex, cls.name: own | {"delay": delay, "omega": reflex["omega"]}}
            for delay in LATE_DELAYS
        ]
