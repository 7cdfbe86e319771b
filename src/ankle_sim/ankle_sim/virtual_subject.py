"""A simulated subject: what co-contraction, push and reflex excitability make of K, G, torque and
EMG.

Calf and shin muscles act against each other. With the co-contraction c (0 to 1) the calf holds ``c
F`` and the shin the same, so that the net torque does not change; a push P (plantarflexing, N.m) is
added to the calf:

    calf = c F + max(P, 0),  shin = c F + max(-P, 0)                                     [N.m]
    K    = K_rest + K_range (1 - exp(-(calf + shin) / saturation))                   [N.m/rad]
    G    = sum over SOL, GL, GM of G_range e (1 + calf / compensation) share       [N.m.s/rad]

F is the torque of the largest co-contraction and e the excitability. Stiffness saturates with
muscle force; the reflex grows with the calf's activity.

Every hold draws how the muscles share force and reflex: the same joint torque comes from another
mixture of SOL, GL and GM each time, so no single electrode tells K or G. Every subject has other
slopes and intercepts (`draw_subject`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ankle_interfaces.errors import QuantityError

CALF = np.array([True, False, True, True])
FORCE_SHARE = np.array([0.55, 1.0, 0.15, 0.30])
"""Share of a muscle in its group's torque: physiological cross-section, Ward et al. 2009 (soleus
51, GL 10, GM 21 cm^2), with the gastrocnemii counted a little higher; the shin group is the
tibialis anterior."""
LARGEST_COCONTRACTION = 10.0
"""[N.m] F: torque that calf and shin hold against each other at c = 1, a quarter of what the shin
can do and a tenth of the calf.
"""
SATURATION = 12.0
"""[N.m] Muscle torque at which 63 % of the stiffness range is reached: stiffness rises with 1 to 8
N.m/rad per N.m at first (Weiss, Hunter & Kearney 1988) and flattens below a third of the maximal
contraction (Hunter & Kearney 1982)."""
GAIN_COMPENSATION = 10.0
"""[N.m] Torque of a group that doubles its reflex gain (Toft et al. 1989: 5 to 10 N.m; Matthews
1986 for the principle).
"""
SHARED_EXCITABILITY = 0.5
"""Part of the variance of the shin's excitability that it shares with the calf: training aims at
the calf.
"""
FORCE_VARIATION = 0.15
"""Coefficient of variation, from hold to hold, of a muscle's share in the force: 10 to 20 % between
repeated weak contractions.
"""
STIFFNESS_VARIATION = 0.10
"""The stiffness that muscle force adds varies by this relative standard deviation between holds:
fibre length, thixotropy, other muscles about the ankle.
"""
REFLEX_VARIATION = 0.20
"""A muscle's share in the reflex varies by this relative standard deviation between holds."""
REACHING_TIME = 2.0
"""[s] Time constant with which a subject goes to a new state."""


@dataclass(frozen=True)
class Subject:
    """Holds the numbers in which one simulated subject differs from another (`draw_subject`).

    Attributes
    ----------
    name
        As ``subject 1``.
    K_rest
        Stiffness of the relaxed ankle [N.m/rad].
    K_range
        What muscle force can add [N.m/rad].
    G_range
        Reflex gain at full excitability without background force [N.m.s/rad].
    B
        Viscosity [N.m.s/rad].
    I
        Inertia of foot and footplate [kg.m^2].
    emg_rest
        Rms of each muscle at rest [V], shape (4,).
    emg_slope
        Rms per torque of the muscle's group [V/N.m], shape (4,).
    burst
        Rms of the reflex burst per stretch velocity at G = 10 N.m.s/rad [V.s/rad], shape (4,).
    """

    name: str
    K_rest: float
    K_range: float
    G_range: float
    B: float
    I: float
    emg_rest: np.ndarray
    emg_slope: np.ndarray
    burst: np.ndarray


def draw_subject(number: int) -> Subject:
    """Return the simulated subject of a number, always the same one.

    Stiffness of a relaxed ankle 25 to 45 N.m/rad and the paper's B and I (section III-A) within 20
    and 10 %; electrodes differ by a factor of two between people and muscles, as skin and
    subcutaneous fat do.
    """
    random = np.random.default_rng([5_113, number])

    def spread(size: int) -> np.ndarray:
        return np.exp(random.uniform(-0.5 * math.log(2.0), 0.5 * math.log(2.0), size))

    return Subject(
        f"subject {number}",
        K_rest=float(random.uniform(25.0, 45.0)),
        K_range=float(random.uniform(80.0, 120.0)),
        G_range=float(random.uniform(6.0, 10.0)),
        B=0.63 * float(random.uniform(0.8, 1.2)),
        I=0.0137 * float(random.uniform(0.9, 1.1)),
        emg_rest=1.0e-6 * spread(4),
        # About 2 uV rms per N.m over the calf and 5 over the shin: 200 uV in a contraction of 100
        # N.m and 40 N.m.
        emg_slope=np.array([2.0e-6, 5.0e-6, 1.5e-6, 2.0e-6]) * spread(4),
        # 20 uV.s/rad: at the 2 rad/s of the paper's perturbation a burst of 40 uV rms in the
        # soleus, half as much in the others.
        burst=np.array([2.0e-5, 1.0e-5, 1.0e-5, 1.5e-5]) * spread(4),
    )


@dataclass(frozen=True)
class State:
    """Describes what a subject does.

    Attributes
    ----------
    cocontraction
        C, 0 to 1.
    excitability
        Of the calf's reflex, 0 to 1.
    push
        Torque that the subject exerts towards plantarflexion [N.m]; 5 is the paper's target of -5
        N.m.

    Raises
    ------
    QuantityError
        A value out of range, with its name and range.
    """

    cocontraction: float = 0.3
    excitability: float = 0.5
    push: float = 0.0

    def __post_init__(self) -> None:
        for name, lower, upper, unit in (
            ("cocontraction", 0.0, 1.0, ""),
            ("excitability", 0.0, 1.0, ""),
            ("push", -20.0, 20.0, " N.m"),
        ):
            value = getattr(self, name)
            if not lower <= value <= upper:
                raise QuantityError(
                    f"{name} = {value:g}{unit} is refused; allowed: {lower:g} to {upper:g}{unit}"
                )


@dataclass(frozen=True)
class Drive:
    """Describes the joint and the electrodes in one state of the subject.

    Attributes
    ----------
    K
        Stiffness [N.m/rad].
    G
        Reflex gain [N.m.s/rad].
    torque
        Voluntary torque that the rig measures [N.m]: a push towards plantarflexion needs a
        dorsiflexing torque to hold the ankle.
    background
        Rms of each muscle [V], shape (4,).
    burst
        Rms of each muscle's burst per stretch velocity [V.s/rad], shape (4,).
    """

    K: float
    G: float
    torque: float
    background: np.ndarray
    burst: np.ndarray

    def towards(self, other: Drive, share: float) -> Drive:
        """Return a part of the way to another drive, share 0 to 1."""
        mix = [
            mine + share * (theirs - mine)
            for mine, theirs in zip(vars(self).values(), vars(other).values(), strict=True)
        ]
        return Drive(*mix)


class VirtualSubject:
    """Simulates a subject who goes from one commanded state to the next.

    Parameters
    ----------
    subject
        The simulated subject.
    seed
        Of what differs from hold to hold.
    steady
        K and G follow from the state alone; muscles still share them differently from hold to hold.
    """

    def __init__(self, subject: Subject, seed: int, steady: bool = False) -> None:
        self.subject = subject
        self._steady = steady
        self._random = np.random.default_rng([5_119, seed])
        self._target: Drive | None = None
        self._present: Drive | None = None

    def command(self, state: State) -> Drive:
        """Command a new state; the mixture of muscles is drawn anew.

        Returns
        -------
        Drive
            The drive that will be reached.
        """
        s = self.subject
        force = FORCE_SHARE * _lognormal(self._random, FORCE_VARIATION)
        reflex = FORCE_SHARE * _lognormal(self._random, REFLEX_VARIATION)
        own_excitability = self._random.uniform()
        calf = state.cocontraction * LARGEST_COCONTRACTION + max(state.push, 0.0)
        shin = state.cocontraction * LARGEST_COCONTRACTION + max(-state.push, 0.0)
        group = np.where(CALF, calf, shin)
        # The shares of the calf add up to its torque; what one muscle does less the others do more.
        force[CALF] /= force[CALF].sum()
        added = s.K_range * (1.0 - math.exp(-(calf + shin) / SATURATION))
        stiffness = float(_lognormal(self._random, STIFFNESS_VARIATION)[0])
        if self._steady:
            reflex[CALF] /= reflex[CALF].sum()
            stiffness = 1.0
        K = s.K_rest + added * stiffness
        compensation = 1.0 + group / GAIN_COMPENSATION
        shin_excitability = (
            SHARED_EXCITABILITY * state.excitability
            + (1.0 - SHARED_EXCITABILITY) * own_excitability
        )
        excitability = np.where(CALF, state.excitability, shin_excitability)
        gains = s.G_range * excitability * compensation * reflex
        background = np.hypot(s.emg_rest, s.emg_slope * group * force / FORCE_SHARE)
        burst = s.burst * gains / FORCE_SHARE / 10.0
        self._target = Drive(K, float(gains[CALF].sum()), state.push, background, burst)
        if self._present is None:
            self._present = self._target
        return self._target

    def advance(self, seconds: float) -> Drive:
        """Return the drive after some more time [s], on the way to the last commanded state.

        Raises
        ------
        ValueError
            No state was commanded.
        """
        if self._target is None or self._present is None:
            raise ValueError(f"{self.subject.name} was given no state")
        self._present = self._present.towards(
            self._target, 1.0 - math.exp(-seconds / REACHING_TIME)
        )
        return self._present


def _lognormal(random: np.random.Generator, variation: float) -> np.ndarray:
    """Return four factors of mean 1 with a coefficient of variation."""
    variance = math.log1p(variation**2)
    return np.exp(math.sqrt(variance) * random.standard_normal(4) - 0.5 * variance)
