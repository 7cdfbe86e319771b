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
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.foot_motion import foot_motion
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

    def rest(self) -> np.ndarray:
        """Return the torque that is not like an impedance [N.m], shape (n,)."""
        return self.torque - torque_of(self.like, self.position, self.velocity, self.acceleration)


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
    def powers(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return 1, s and s^2 at each frequency, s in rad/s."""
        s = 2j * np.pi * rfftfreq(self.length, 1.0 / self.rate)
        return np.ones(len(s)), s, s * s

    @cached_property
    def spectra(self) -> list[np.ndarray]:
        """Return the spectra of position, velocity and acceleration, each about its mean."""
        signals = self.position, self.velocity, self.acceleration
        found = [rfft(signal - signal.mean(), self.length) for signal in signals]
        return [found[0] * power for power in self.powers] if self.jumps else found


Mover = Callable[[np.ndarray, Impedance], tuple[np.ndarray, np.ndarray, np.ndarray]]


def mover(plate: Plate, fixation: CompliantCoupling, values: Values, own: Impedance) -> Mover:
    """Return a function that moves a foot behind a fixation.

    It takes torque [N.m], shape (n,), that pushes against the foot's movement, and an impedance
    that acts beside its own. It returns position about the mean [rad], velocity [rad/s] and
    acceleration [rad/s^2] of the foot, each of shape (n,). The mean of the torque moves nothing:
    angles and stiffness of terms hold at the recording's mean load.

    Parameters
    ----------
    plate
        That drives the foot.
    fixation, values
        The coupling and its parameter values.
    own
        Impedance of the foot.
    """
    one, s, squared = plate.powers
    spring, damping = fixation.linearised(values)
    strap = spring + damping * s
    held = strap + own[2] + own[1] * s + own[0] * squared
    samples = len(plate.position)

    def through_a_line(
        push: np.ndarray, like: Impedance
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        gives = 1.0 / (held + like[2] + like[1] * s + like[0] * squared)
        driven = strap * gives
        pushed = rfft(push - push.mean(), plate.length) * gives
        x, v, a = (
            irfft(spectrum * driven - pushed * power, plate.length)[:samples]
            for spectrum, power in zip(plate.spectra, (one, s, squared), strict=True)
        )
        return x, v, a

    def through_a_curve(
        push: np.ndarray, like: Impedance
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        inertia, viscosity, stiffness = (a + b for a, b in zip(own, like, strict=True))
        x, v, a = foot_motion(
            fixation,
            values,
            (inertia, viscosity, stiffness),
            (plate.position, plate.velocity),
            plate.rate,
            push - push.mean(),
        )
        return x, v, a

    return through_a_line if fixation.linear else through_a_curve


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
    s = 2j * np.pi * frequency
    passes = strap[0] + strap[1] * s
    inertia, viscosity, stiffness = impedance
    return np.asarray(passes / (passes + inertia * s**2 + viscosity * s + stiffness))


# A foot that runs away is noticed, and needs no warning of its own.
@np.errstate(over="ignore", invalid="ignore")
def found_foot(
    moved: Mover,
    torque: Callable[[Foot], np.ndarray],
    samples: int,
    holds: Impedance,
    rounds: int = MOST_ROUNDS,
) -> Foot:
    """Return the foot whose motion and torque agree.

    Parameters
    ----------
    moved
        As `mover` gives it.
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
    unmoved = foot = Foot(*moved(nothing, NO_IMPEDANCE), nothing, NO_IMPEDANCE)
    step, before = 1.0, np.inf
    for number in range(1, rounds + 1):
        acting = torque(foot)
        if not np.isfinite(acting @ acting):
            return unmoved
        motion = foot.position, foot.velocity, foot.acceleration
        foot = Foot(*motion, acting, most_like(acting, *motion, holds))
        if number == rounds:
            break
        after = moved(foot.rest(), foot.like)
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
    signals = np.stack([acceleration, velocity, position])
    known = signals @ signals.T
    size = np.sqrt(np.diag(known))
    size[size == 0.0] = 1.0
    right = signals @ (torque - torque.mean()) / size
    found = np.linalg.lstsq(known / np.outer(size, size), right, rcond=1e-9)[0] / size
    least = -LARGEST_NEGATIVE_SHARE * np.array(holds)
    inertia, viscosity, stiffness = np.maximum(found, least)
    return float(inertia), float(viscosity), float(stiffness)
