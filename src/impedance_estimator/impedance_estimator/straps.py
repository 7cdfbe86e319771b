"""Motion of the foot behind its straps, and what they let through of the torque on the foot.

With a foot of I, B, K behind straps of stiffness k and damping b, the plate's motion x and a torque
T on the foot (a reflex, a further term) reach foot and plate through the same transfer:

    H(s) = (k + b s) / (I s² + (B + b) s + K + k),   foot = H x,   torque at the plate = Z H x + H T

The measured torque takes no part in it, so that torque which no movement causes does not get into
the regressors. At rest H is k / (k + K): the reflex is seen that much smaller. Terms on the foot
follow its motion, and move it::

    foot = H x - T / (I s² + (B + b) s + K + k)

T is taken along H x first, and then along this motion.
"""

from __future__ import annotations

import math

import numpy as np

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.linear_dynamics import FirstOrder, LedSecondOrders, SecondOrder
from ankle_physics.model import Entry, Model

LARGEST_CORE_STIFFNESS = 1000.0
"""[N.m/rad] No ankle is stiffer, whatever an estimate says."""
LOAD_TIME = 10.0
"""[s] Torque that lasts longer than an estimate's memory is load: angles of a model hold under it.
"""


class Straps:
    """Computes the transfer from the plate to the foot, kept between blocks.

    Parameters
    ----------
    model
        With one `CompliantCoupling`, and I, B and K of the foot.
    rate
        Sampling rate [Hz].
    measured_velocity
        Whether velocity is a channel of its own.
    """

    def __init__(self, model: Model, rate: float, measured_velocity: bool) -> None:
        entry = coupling(model)
        assert entry is not None
        assert isinstance(entry.term, CompliantCoupling)
        self._k, self._b = entry.term.linearised(entry.values)
        self._inertia = float(model.entry("inertia").values["I"])
        self._viscosity = float(model.entry("viscosity").values["B"])
        self._stiffness = float(model.entry("stiffness").values["K"])
        self._measured = measured_velocity
        # Position, velocity and reference.
        self._motion, self._differentiated = LedSecondOrders(rate, 3), SecondOrder(rate)
        self._pushed, self._load = SecondOrder(rate), FirstOrder(rate)
        self._rate = rate
        self._torques: dict[str, LedSecondOrders] = {}
        self._middle = np.nan

    @property
    def share(self) -> float:
        """Return H at rest, the share of a slow movement that reaches the foot [1]."""
        return self._k / (self._k + self._stiffness)

    def follow(self, stiffness: float) -> None:
        """Take over the stiffness of the foot [N.m/rad] that is estimated."""
        if math.isfinite(stiffness):
            self._stiffness = min(max(stiffness, 0.0), LARGEST_CORE_STIFFNESS)

    def foot(
        self, x: np.ndarray, v: np.ndarray, reference: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return position [rad] and velocity [rad/s] of the foot, and the reference [rad] through
        the same transfer.

        Parameters
        ----------
        x, v, reference
            Position, velocity and commanded position of the plate, shape (n,).
        """
        if not np.isfinite(self._middle):
            self._middle = float(x[0])
        middle = self._middle
        position, rate, commanded = self._through(
            self._motion, np.array([x - middle, v, reference - middle])
        )
        if not self._measured:
            _, slope, bend = self._differentiated.run_with_rates(x - middle, *self._resonance)
            rate = self.share * (slope + self._lead * bend)
        return position + middle, rate, commanded + middle

    def pushed(self, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return by how much a torque on the foot moves it, position [rad] and velocity [rad/s].

        Parameters
        ----------
        torque
            Against the foot's movement [N.m], shape (n,).
        """
        lasting = self._load.run(torque, LOAD_TIME)
        x, v, _ = self._pushed.run_with_rates(torque - lasting, *self._resonance)
        total = self._stiffness + self._k
        return x / total, v / total

    def at_plate(self, name: str, torques: np.ndarray) -> np.ndarray:
        """Return what reaches the plate of torques on the foot [N.m], shape (m, n).

        Parameters
        ----------
        name
            Of these torques: each has a state of its own.
        torques
            On the foot [N.m], shape (m, n).
        """
        state = self._torques.get(name)
        if state is None:
            state = self._torques[name] = LedSecondOrders(self._rate, len(torques))
        return self._through(state, torques)

    @property
    def _resonance(self) -> tuple[float, float]:
        """Return natural frequency [rad/s] and damping ratio [1] of the foot in its straps."""
        total = self._stiffness + self._k
        damping = (self._viscosity + self._b) / (2.0 * math.sqrt(total * self._inertia))
        return math.sqrt(total / self._inertia), damping

    @property
    def _lead(self) -> float:
        """Return the time by which the straps' damper leads their spring [s]."""
        return self._b / self._k

    def _through(self, state: LedSecondOrders, signals: np.ndarray) -> np.ndarray:
        return self.share * state.run(signals, *self._resonance, self._lead)


def coupling(model: Model) -> Entry | None:
    """Return the entry of the compliant coupling of a model; None where there is none."""
    return next((e for e in model.entries if isinstance(e.term, CompliantCoupling)), None)
