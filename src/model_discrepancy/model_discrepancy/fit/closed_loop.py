"""The movement that a servo which gives way would have made without the torque that no movement
causes.

Such torque d (voluntary torque, tremor, a reflex that varies) moves the plate by ``e = -C (d + Z e
+ f(v) - f(v - de/dt))``: C [rad/N.m] is the compliance of the servo, Z the impedance of joint and
plate, and f the dry friction of the plate's bearing, which lets little torque move a plate that
rests. Without friction it is ``e = -C d / (1 + C Z)`` (a closed loop, Ljung 1999, System
Identification, section 13.4).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.sparse.linalg import LinearOperator, gmres

from ankle_physics.signals import Signals
from ankle_physics.term import Values, term_library
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.generic_bank import GenericBank
from model_discrepancy.recording.compliance import Compliance
from model_discrepancy.recording.motion import Motion
from model_discrepancy.recording.spectrum import Spectrum, share_above

# The slope of the friction is taken between the velocities with and without d, and the latter are
# known better after each round. A third one changes e by less than a thousandth.
_ROUNDS = 2
# Share of e to which each round is solved; the noise of the movement is larger.
_ACCURACY = 1e-3
# Velocities that differ by less have no slope between them [rad/s]: a fortieth of the speed within
# which the sharpest friction turns.
_LEAST_DIFFERENCE = 1e-4
# Of a solution. Friction of 1 N.m behind a servo of 2500 N.m/rad needs 10 to 30. One of 2 N.m that
# turns within 0.005 rad/s, behind 1000 N.m/rad, is not solved in 400; each step comes nearer.
_MOST_STEPS = 80
_INERTIAS = ("inertia", "I"), ("footplate_inertia", "Ip")


@dataclass(frozen=True)
class Load:
    """Describes what resists a movement of the plate at once.

    Attributes
    ----------
    inertia, viscosity, stiffness
        Of joint and plate [kg.m^2, N.m.s/rad, N.m/rad].
    friction
        Values of the terms of dry friction by their names; empty without friction.
    """

    inertia: float = 0.0
    viscosity: float = 0.0
    stiffness: float = 0.0
    friction: Mapping[str, Values] = field(default_factory=dict)

    @classmethod
    def of(cls, fit: Fit) -> Load:
        """Return the load of a fit; 0 where it has no such term."""

        def value(name: str, symbol: str) -> float:
            return float(fit.values.get(name, {}).get(symbol, 0.0))

        library = term_library()
        dry = [name for name in fit.terms if library[name].rest_torque]
        turning = [library[name].turned_by for name in dry]
        return cls(
            sum(value(*inertia) for inertia in _INERTIAS),
            value("viscosity", "B"),
            value("stiffness", "K"),
            {name: fit.values[name] for name in (*dry, *turning) if name in fit.values},
        )

    def impedance(self, frequency: np.ndarray) -> np.ndarray:
        """Return the impedance without friction at each frequency [Hz], complex [N.m/rad]."""
        s = 2j * np.pi * frequency
        return np.asarray(self.inertia * s**2 + self.viscosity * s + self.stiffness)

    def dry_torque(self, motion: Motion) -> np.ndarray:
        """Return the torque of dry friction in a movement [N.m], shape (n,)."""
        library = term_library()
        signals = Signals(motion.rate, motion.position, motion.velocity, motion.acceleration)
        total = np.zeros(len(motion.position))
        for name, values in self.friction.items():
            term = library[name]()
            columns = term.torque(signals, values, term.start(motion.rate))
            total += sum(values[symbol] * column for symbol, column in columns.items())
        return total


def undisturbed(
    motion: Motion, compliance: Compliance, disturbance: np.ndarray, load: Load, noise: float = 0.0
) -> Motion:
    """Return the movement as it would have been without a torque that no movement causes.

    Parameters
    ----------
    motion
        As it was, of n samples.
    compliance
        That lets this torque move the plate.
    disturbance
        Torque [N.m], shape (n,), that the model does not make of the movement.
    load
        What the servo moves beside it.
    noise
        Power density of the flat noise that the disturbance holds [N^2.m^2/Hz]. The torque sensor's
        noise moves nothing that was measured. Where the movement was made of this very torque, it
        holds such noise too, and 0 is right.

    Returns
    -------
    Motion
        With another position, velocity and acceleration [rad, rad/s, rad/s^2], shape (n,).
    """
    spectrum = Spectrum(disturbance - disturbance.mean(), motion.rate, 1)
    giving = compliance.response(spectrum.frequency)
    gain = giving / (1.0 + giving * load.impedance(spectrum.frequency))
    acts = share_above(spectrum.values, spectrum.power_of(noise))
    without_friction = spectrum.read(acts * gain)
    free = _away(motion, without_friction)
    if not load.friction:
        return free
    before, back = load.dry_torque(motion), without_friction
    for _ in range(_ROUNDS):
        faster = free.velocity - motion.velocity
        resisting = (load.dry_torque(free) - before) * faster
        slope = np.maximum(resisting, 0.0) / (faster**2 + _LEAST_DIFFERENCE**2)
        back = _held_back(without_friction, slope, gain, motion.rate, back)
        free = _away(motion, back)
    return free


def _held_back(
    free: np.ndarray,
    slope: np.ndarray,
    gain: np.ndarray,
    rate: float,
    first: np.ndarray,
) -> np.ndarray:
    """Return the movement [rad] that is left of one without friction where a damping that changes
    with time [N.m.s/rad] resists it, from a first guess; gain is that of the plate [rad/N.m].
    """

    def answered(moved: np.ndarray) -> np.ndarray:
        spectrum = Spectrum(moved, rate, 1)
        damped = Spectrum(slope * spectrum.read(2j * np.pi * spectrum.frequency), rate, 1)
        return moved + damped.read(gain)

    count = len(free)
    equation = LinearOperator((count, count), matvec=answered, dtype=float)
    solved, _ = gmres(equation, free, x0=first, rtol=_ACCURACY, restart=_MOST_STEPS, maxiter=1)
    return np.asarray(solved)


def _away(motion: Motion, moved: np.ndarray) -> Motion:
    """Return a motion with a movement [rad] added to it."""
    spectrum = Spectrum(moved, motion.rate, 1)
    s = 2j * np.pi * spectrum.frequency
    return replace(
        motion,
        position=motion.position + moved,
        velocity=motion.velocity + spectrum.read(s),
        acceleration=motion.acceleration + spectrum.read(s**2),
    )


def uncaused(unloaded: Motion, fitter: Fitter, base: Fit) -> np.ndarray:
    """Return the torque that no movement causes [N.m], at the model's rate, shape (n,).

    It is in what the base model leaves, together with physics that this model lacks. The movement
    of the servo without a load is independent of it. So what generic regressors of this movement
    predict is such physics, and its share of the movement has to stay there.

    Parameters
    ----------
    unloaded
        The movement that the servo would make without a load.
    fitter, base
        The base model's fit.
    """
    bank = GenericBank(fitter.along(unloaded).columns)
    return fitter.rows.torque(base.left - bank.prediction(bank.learn(base.plain)))
