"""Motion of a foot behind a compliant fixation, and of what else acts on it.

The plate drives the foot through the fixation S; the foot's own impedance Z and the torque T of
every other term on the foot, which follows its motion x_foot, act against it::

    (S + Z) x_foot = S x_plate - T(x_foot)

A term that gives torque in phase with the motion, as a yielding spring does, moves the foot by a
part of what the foot moves anyway. So T is split into the impedance Z_T that is most like it (least
squares) and a rest, and the foot is found again and again from the rest of the motion before::

    (S + Z + Z_T) x_foot = S x_plate - (T - Z_T x_foot)

The motion is held while a fit takes its steps. To first order the reading at the plate is then
right beside it, too: T passes ``H = S / (S + Z + Z_T)`` on its way, and what H does not pass of the
held torque is added as it is (`Columns.offset`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import count

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.foot_motion import foot_motion
from ankle_physics.foot_spectrum import foot_spectra, foot_torque_spectrum, passed_share
from ankle_physics.term import Values

Impedance = tuple[float, float, float]
NO_IMPEDANCE: Impedance = (0.0, 0.0, 0.0)
# Each round leaves a tenth of the change of the one before; a foot whose terms are as stiff as its
# fixation needs some more.
MOST_ROUNDS = 16
# Change of the foot's velocity in a round, of its rms, at which it is found. One more round follows
# in what the columns make of it, so that a third of this or less is left: noise at 50 dB.
FOUND_CHANGE = 1e-2
# Near its resonance, a foot whose stiffness or damping differs much from moment to moment swings
# from round to round where each goes the whole way. Where a round leaves more than this share of
# the change of the one before, further ones go half of the way.
SLOW_CHANGE = 0.5
SHORT_STEP = 0.5
# An impedance that is most like some torque may be negative, but takes no more than this share of
# what holds the foot: it would leave the foot without hold.
LARGEST_NEGATIVE_SHARE = 0.7
_numbers = count()


@dataclass(frozen=True, eq=False)
class Push:
    """Holds torque that pushes against a foot's movement.

    Its mean moves nothing: angles and stiffness of terms hold at the recording's mean load.

    Attributes
    ----------
    torque
        [N.m], shape (n,).
    """

    torque: np.ndarray
    _spectra: dict[int, np.ndarray] = field(default_factory=dict, repr=False)

    @cached_property
    def centred(self) -> np.ndarray:
        """Return the torque about its mean [N.m], shape (n,)."""
        return np.asarray(self.torque - self.torque.mean())

    def spectrum(self, length: int) -> np.ndarray:
        """Return the spectrum of the torque about its mean, padded to a length; remembered, since
        the foot is moved by the same torque for each of many values.
        """
        if length not in self._spectra:
            self._spectra[length] = rfft(self.centred, length)
        return self._spectra[length]


@dataclass(frozen=True, eq=False)
class Foot:
    """Holds the motion of a foot, and the torque on it.

    Attributes
    ----------
    position
        About the recording's mean [rad], shape (n,).
    velocity, acceleration
        [rad/s], [rad/s^2], each of shape (n,).
    torque
        Of every term on the foot but its own impedance [N.m], shape (n,).
    like
        Inertia [kg.m^2], viscosity [N.m.s/rad] and stiffness [N.m/rad] that are most like it.
    number
        Tells it from every other foot.
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    torque: np.ndarray
    like: Impedance
    number: int = field(default_factory=lambda: next(_numbers))

    @cached_property
    def rest(self) -> Push:
        """Return the torque that is not like an impedance."""
        own = torque_of(self.like, self.position, self.velocity, self.acceleration)
        return Push(self.torque - own)


def torque_of(
    impedance: Impedance, position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray
) -> np.ndarray:
    """Return the torque of an impedance on a motion [N.m], shape (n,)."""
    inertia, viscosity, stiffness = impedance
    return np.asarray(inertia * acceleration + viscosity * velocity + stiffness * position)


@dataclass(frozen=True, eq=False)
class Plate:
    """Holds the motion that drives a foot through a fixation.

    Attributes
    ----------
    rate
        Of the samples [Hz].
    position
        About the recording's mean [rad], shape (n,).
    velocity, acceleration
        [rad/s], [rad/s^2], each of shape (n,).
    jumps
        Whether the velocity jumps, as behind play, so that the acceleration does not hold all of
        its change.
    """

    rate: float
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    jumps: bool = False

    @cached_property
    def length(self) -> int:
        """Return the number of samples that are transformed: a second of rest follows."""
        return int(next_fast_len(len(self.position) + int(self.rate), real=True))

    @cached_property
    def step(self) -> float:
        """Return the distance between two frequencies of its spectra [rad/s]."""
        return 2.0 * np.pi * self.rate / self.length

    @cached_property
    def spectra(self) -> np.ndarray:
        """Return the spectra of position, velocity and acceleration, each about its mean, shape (3,
        m).
        """
        signals = self.position, self.velocity, self.acceleration
        found = np.array([rfft(signal - signal.mean(), self.length) for signal in signals])
        if self.jumps:
            s = 1j * self.step * np.arange(found.shape[1])
            found[1], found[2] = s * found[0], s * s * found[0]
        return found


@dataclass(frozen=True, eq=False)
class Mover:
    """Moves a foot behind a fixation.

    Attributes
    ----------
    plate
        That drives the foot.
    fixation, values
        The coupling and its parameter values.
    own
        Impedance of the foot.
    """

    plate: Plate
    fixation: CompliantCoupling
    values: Values
    own: Impedance

    def moved(self, push: Push, like: Impedance) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return position about the mean [rad], velocity [rad/s] and acceleration [rad/s^2] of the
        foot, each of shape (n,).

        Parameters
        ----------
        push
            Torque against the foot's movement.
        like
            Impedance that acts beside its own.
        """
        if self.fixation.linear:
            found = foot_spectra(*self._line(push, like))
            x, v, a = (self._signal(spectrum) for spectrum in found)
            return x, v, a
        inertia, viscosity, stiffness = (a + b for a, b in zip(self.own, like, strict=True))
        plate = self.plate
        x, v, a = foot_motion(
            self.fixation,
            self.values,
            (inertia, viscosity, stiffness),
            (plate.position, plate.velocity),
            plate.rate,
            push.centred,
        )
        return x, v, a

    def torque(self, push: Push, like: Impedance, of: Impedance) -> np.ndarray:
        """Return the torque of an impedance on the foot's motion [N.m], shape (n,), at a third of
        the cost of the motion where the fixation is linear.

        Parameters
        ----------
        push, like
            As `moved` takes them.
        of
            The impedance whose torque is wanted.
        """
        if self.fixation.linear:
            return self._signal(foot_torque_spectrum(*self._line(push, like), np.array(of)))
        return torque_of(of, *self.moved(push, like))

    def _line(
        self, push: Push, like: Impedance
    ) -> tuple[np.ndarray, np.ndarray, float, np.ndarray]:
        """Return what the motion behind a line follows from, as `foot_spectra` takes it."""
        impedance = [a + b for a, b in zip(self.own, like, strict=True)]
        impedance += self.fixation.linearised(self.values)
        plate = self.plate
        return plate.spectra, push.spectrum(plate.length), plate.step, np.array(impedance)

    def _signal(self, spectrum: np.ndarray) -> np.ndarray:
        """Return what has a spectrum, shape (n,)."""
        found: np.ndarray = irfft(spectrum, self.plate.length)[: len(self.plate.position)]
        return found


def transmission(
    frequency: np.ndarray, strap: tuple[float, float], impedance: Impedance
) -> np.ndarray:
    """Return the share of the plate's motion that reaches the foot, complex, at each frequency
    [Hz].

    Parameters
    ----------
    frequency
        [Hz], shape (n,).
    strap
        Stiffness [N.m/rad] and damping [N.m.s/rad] of the fixation.
    impedance
        Of the foot, and of what acts like one beside it.
    """
    return passed_share(frequency, np.array([*impedance, *strap], dtype=float))


# A foot that runs away is noticed, and needs no warning of its own.
@np.errstate(over="ignore", invalid="ignore")
def found_foot(
    mover: Mover,
    torque: Callable[[Foot], np.ndarray],
    samples: int,
    holds: Impedance,
    rounds: int = MOST_ROUNDS,
) -> Foot:
    """Return the foot whose motion and torque agree.

    Parameters
    ----------
    mover
        Of the foot.
    torque
        Returns the torque [N.m] of every term on a foot but its own impedance, shape (n,).
    samples
        n.
    holds
        Inertia, viscosity and stiffness of foot and fixation together.
    rounds
        At most so many.

    Returns
    -------
    Foot
        Without torque where the torque runs away.
    """
    nothing = np.zeros(samples)
    alone = mover.moved(Push(nothing), NO_IMPEDANCE)
    unmoved = foot = Foot(*alone, nothing, NO_IMPEDANCE)
    step, before = 1.0, np.inf
    for number in range(1, rounds + 1):
        acting = torque(foot)
        if not np.isfinite(acting @ acting):
            return unmoved
        motion = foot.position, foot.velocity, foot.acceleration
        foot = Foot(*motion, acting, most_like(acting, *motion, holds))
        if number == rounds:
            break
        after = mover.moved(foot.rest, foot.like)
        changes = [new - old for new, old in zip(after, motion, strict=True)]
        if not np.isfinite(sum(change @ change for change in changes)):
            return unmoved
        change = float(np.std(changes[1]) / np.std(foot.velocity))
        if change <= FOUND_CHANGE:
            break
        if change > SLOW_CHANGE * before:
            step = SHORT_STEP
        before = change
        x, v, a = (old + step * new for old, new in zip(motion, changes, strict=True))
        foot = Foot(x, v, a, acting, foot.like)
    return foot


def most_like(
    torque: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray,
    acceleration: np.ndarray,
    holds: Impedance,
) -> Impedance:
    """Return the impedance whose torque on a motion is most like a given one.

    Parameters
    ----------
    torque
        [N.m], shape (n,).
    position, velocity, acceleration
        [rad], [rad/s], [rad/s^2], each of shape (n,).
    holds
        What holds the foot, of which a negative impedance takes `LARGEST_NEGATIVE_SHARE` at most.
    """
    signals = acceleration, velocity, position
    known = np.array([[one @ other for other in signals] for one in signals])
    size = np.sqrt(np.diag(known))
    size[size == 0.0] = 1.0
    centred = torque - torque.mean()
    right = np.array([signal @ centred for signal in signals]) / size
    found = np.linalg.lstsq(known / np.outer(size, size), right, rcond=1e-9)[0] / size
    least = -LARGEST_NEGATIVE_SHARE * np.array(holds)
    inertia, viscosity, stiffness = np.maximum(found, least)
    return float(inertia), float(viscosity), float(stiffness)
