"""The torque of the terms that run beside the regression, through the term library."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.linear_dynamics import FirstOrder
from ankle_physics.model import Entry, Model
from ankle_physics.model_run import PLATE, ModelRun
from ankle_physics.signals import Signals
from ankle_physics.term import REFLEX_PLACES, Place
from impedance_estimator.known_physics import (
    REFLEX_WITH_GAIN,
    SUPPORTED_TERMS,
    KnownPhysics,
    shaping_terms,
)

LEAST_PROJECTION = 0.2
"""A shape of which the plain reflex shows less cannot be followed; the standard error says so."""
PROJECTION_TIME = 1.0
"""[s] Slower than this the voluntary torque hides the reflex."""
MEASURED, COMMANDED = "measured", "commanded"
_BEFORE_REFLEX = (*REFLEX_PLACES, Place.ACTIVATION)
"""Terms there change what the reflex answers."""


class HeldTorques:
    """Makes the torque that the held terms add to the joint's core."""

    def __init__(self, model: Model, rate: float, modelled_reflex: bool) -> None:
        held = [entry for entry in model.entries if _is_held(entry)]
        reflex = [entry for entry in model.entries if entry.term.name == "reflex"]
        self.any = bool(held) or modelled_reflex
        self._modelled = modelled_reflex
        self._plate = {e.term.name for e in held if e.term.place in PLATE}
        self._shaped = not modelled_reflex and bool(shaping_terms(model)) and bool(reflex)
        self._all = _run([*held, *(reflex if self._shaped or modelled_reflex else [])], rate)
        self._plain = _run(reflex, rate)
        self._commanded = _run(
            [e for e in (*held, *reflex) if e.term.place in _BEFORE_REFLEX or _is_reflex(e)], rate
        )
        self._slow = FirstOrder(rate), FirstOrder(rate)
        self._square = self._cross = 0.0

    @property
    def projection(self) -> float:
        """Return how much of the plain reflex a regression finds in the shaped one [1]; 1 without a
        shape.

        A reflex that is g times the calibrated one leaves (g - 1) times the shaped reflex beside
        the plain one, and only this share of it shows in the regression.
        """
        if not self._square > 0.0:
            return 1.0
        return max(self._cross / self._square, LEAST_PROJECTION)

    def torques(self, signals: Callable[[], Signals]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the torque [N.m] on the plate and on the foot, and that of a modelled reflex (0
        where it is not modelled), each of shape (n,).

        Parameters
        ----------
        signals
            Makes the motion of plate and foot; terms change it.
        """
        whole = self._all.torque(signals())
        nothing = np.zeros(len(whole))
        parts = self._all.parts.items()
        plate = sum((torque for name, torque in parts if name in self._plate), nothing)
        reflex = sum((torque for name, torque in parts if name in REFLEX_WITH_GAIN), nothing)
        if self._modelled:
            return plate, whole - plate - reflex, reflex
        if not self._shaped:
            return plate, whole - plate, nothing
        plain = self._plain.torque(signals())
        a = plain - self._slow[0].run(plain, PROJECTION_TIME)
        b = reflex - self._slow[1].run(reflex, PROJECTION_TIME)
        self._square += float(a @ a)
        self._cross += float(a @ b)
        return plate, whole - plate - plain, nothing

    def commanded_reflex(self, signals: Signals) -> np.ndarray:
        """Return the torque of the modelled reflex along the motion of the reference [N.m].

        Parameters
        ----------
        signals
            That motion.
        """
        self._commanded.torque(signals)
        parts = self._commanded.parts.items()
        return sum(
            (torque for name, torque in parts if name in REFLEX_WITH_GAIN),
            np.zeros(len(signals.position)),
        )


def foot_torques(model: Model, rate: float) -> ModelRun | None:
    """Return the run of every term on the foot beside inertia, viscosity and stiffness, the reflex
    as it was calibrated; None where there is none.

    Parameters
    ----------
    model
        Of rig and subject.
    rate
        Sampling rate [Hz].
    """
    acting = [
        entry
        for entry in model.entries
        if entry.term.name == "reflex" or (_is_held(entry) and entry.term.place not in PLATE)
    ]
    return _run(acting, rate) if acting else None


class TrackedTorques:
    """Makes the torque of the calibrated reflex and of each tracked term at its calibrated size."""

    def __init__(self, known: KnownPhysics, rate: float, modelled_reflex: bool) -> None:
        self._names = [entry.term.name for entry in known.tracked]
        self.on_plate = [False, *(entry.term.place in PLATE for entry in known.tracked)]
        # The sizes in force change; these are of the calibrated ones.
        entries = [Entry(e.term, dict(e.values)) for e in known.model.entries]
        used = [
            e
            for e in entries
            if e.term.name in self._names
            or _is_reflex(e)
            or (_is_held(e) and e.term.place in _BEFORE_REFLEX)
        ]
        plain = [e for e in entries if e.term.name == "reflex"]
        self._modelled = modelled_reflex
        self._runs = {name: (_run(used, rate), _run(plain, rate)) for name in (MEASURED, COMMANDED)}

    def torques(self, name: str, signals: Callable[[], Signals]) -> np.ndarray:
        """Return torques [N.m], shape (1 + count, n).

        Parameters
        ----------
        name
            `MEASURED` or `COMMANDED`: each motion has states of its own.
        signals
            Makes that motion; terms change it.
        """
        shaped, plain = self._runs[name]
        nothing = 0.0 * shaped.torque(signals())
        parts = shaped.parts
        if self._modelled:
            reflex = sum((t for name, t in parts.items() if name in REFLEX_WITH_GAIN), nothing)
        else:
            reflex = plain.torque(signals()) + nothing
        return np.array([reflex, *(parts[name] for name in self._names)])


def _is_reflex(entry: Entry) -> bool:
    return entry.term.name in REFLEX_WITH_GAIN


def _is_held(entry: Entry) -> bool:
    """Return whether a term runs beside the regression and its torque is subtracted."""
    return not (
        entry.term.name in SUPPORTED_TERMS
        or entry.term.place is Place.TORQUE_SENSOR
        or isinstance(entry.term, CompliantCoupling)
    )


def _run(entries: Sequence[Entry], rate: float) -> ModelRun:
    return Model([Entry(e.term, e.values) for e in entries]).start(rate)
