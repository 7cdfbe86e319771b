"""Power-law damping: ``torque = c * (d/dt)^alpha x``, between a spring (0) and a dashpot (1)."""

from __future__ import annotations

import numpy as np

from ankle_physics.linear_dynamics import FirstOrder
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values

# Two relaxations per decade keep the power law within 1 % over the band that perturbations reach
# (0.1 to 100 Hz).
_RATES = 2.0 * np.pi * np.logspace(-2.0, 3.0, 11)
_SPACING = np.log(_RATES[1] / _RATES[0])


class FractionalDamping(Term):
    """Models ``s^alpha = sin(pi alpha)/pi * integral over p of p^(alpha-1) s/(s+p)`` as a sum of
    relaxations.

    Biological tissue creeps and relaxes by a power law (Fabry et al. 2001, Phys. Rev. Lett. 87,
    148102: exponent 0.1 to 0.4).
    """

    name = "fractional_damping"
    place = Place.INTRINSIC
    family = "intrinsic memory"
    separated_by = "steps of several sizes held for two seconds and more"
    has_memory = True
    sentence = "Tissues resist with a power law of time: neither a pure spring nor a pure damper."
    parameters = (
        Parameter(
            "c",
            "N.m.s^alpha/rad",
            0.0,
            500.0,
            10.0,
            "makes up a part of K and B; a loss tangent of 0.05 to 0.3",
            description=(
                "It is the torque of a movement of one radian at an angular frequency of 1 rad/s."
            ),
            linear=True,
        ),
        Parameter(
            "alpha",
            "1",
            0.05,
            0.95,
            0.3,
            "Fabry et al. 2001: 0.1 to 0.4 for cells; up to 0.6 for muscle",
            description="It is the power of time: 0 makes a spring and 1 makes a damper.",
        ),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {"lags": [FirstOrder(rate) for _ in _RATES]}

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        x = signals.foot_position
        alpha = float(values["alpha"])
        total = np.zeros(len(x))
        for p, lag in zip(_RATES, state["lags"], strict=True):
            total += p**alpha * (x - lag.run(x, 1.0 / p))
        return {"c": np.sin(np.pi * alpha) / np.pi * _SPACING * total}
