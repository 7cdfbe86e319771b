"""Stiffness that follows a cycle: ``torque = (kc cos(w t) + ks sin(w t)) * (x - xc)``."""

from __future__ import annotations

import numpy as np

from ankle_physics.operating_parameters import operating_angle
from ankle_physics.run_time import RunTime
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values


class CyclicStiffness(Term):
    """Models stiffness that rises and falls with the phase of a rhythm: breathing, stepping or a
    tracked sine.

    Over the stance phase of walking the stiffness of the ankle changes by a factor of four (Rouse
    et al. 2014, IEEE Trans. Neural Syst. Rehabil. Eng. 22, 870). t counts from the first sample. K
    is the mean over the cycle.
    """

    name = "cyclic_stiffness"
    place = Place.INTRINSIC
    family = "joint follows activation or time"
    follows_time = True
    separated_by = "a recording without the rhythm, and EMG"
    # Its torque depends on when, and not on the angle alone: no part of the tangent stiffness.
    has_memory = True
    resolved_by_duration = "frequency"
    sentence = "Stiffness rises and falls in a steady rhythm."
    parameters = (
        Parameter(
            "kc",
            "N.m/rad",
            -500.0,
            500.0,
            20.0,
            "Rouse et al. 2014: up to a few times the smallest stiffness of the cycle",
            description="It is the part of the stiffness that follows the cosine of the rhythm.",
            linear=True,
        ),
        Parameter(
            "ks",
            "N.m/rad",
            -500.0,
            500.0,
            0.0,
            "as kc; the two make amplitude and phase",
            description="It is the part of the stiffness that follows the sine of the rhythm.",
            linear=True,
        ),
        Parameter(
            "frequency",
            "Hz",
            0.02,
            2.0,
            0.25,
            "breathing 0.2 to 0.3 Hz, stepping 0.5 to 1.2 Hz, slower tracking from 0.02 Hz",
            description="It is the frequency of the rhythm.",
        ),
        operating_angle("It is the angle about which the spring acts."),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {"run_time": RunTime(rate)}

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        time = state["run_time"].advance(len(signals.position))
        phase = 2.0 * np.pi * float(values["frequency"]) * time
        spring = signals.foot_position - values["xc"]
        return {"kc": np.cos(phase) * spring, "ks": np.sin(phase) * spring}
