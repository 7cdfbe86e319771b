"""One recording: drawn again until its effects show, sampled, and stored with its truth."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from second_rig.draw import Case
from second_rig.effects.effect import Change, Effect
from second_rig.effects.register import EFFECTS
from second_rig.laboratory import Laboratory, draw_laboratory, simulated
from second_rig.mechanics import Motion
from second_rig.sampling import CORNER, Clock, Noise, draw_noise, draw_steps, in_steps
from second_rig.strength import draw_wanted, found_strengths, recorded_torque, share
from second_rig.truth import Impedance, true_impedance

SECONDS = 90.0
"""Length of a recording."""
# A laboratory in which an effect does not show is drawn again, at most so often; the last one is
# taken as it is.
ATTEMPTS = 10
# From this attempt on the dealt protocol is taken for one that cannot show the effect.
ATTEMPT_OF_ANOTHER_PROTOCOL = 5
PROTOCOL_THAT_SHOWS_MOST = "random pulses and steps"
# Shares of the torque's variance with which an effect counts as shown, neither lost in the noise
# nor the whole of the torque.
SHARES = (0.005, 0.15)
# More torque than a subject or a sensor takes [N.m].
LARGEST_DEVIATION = 20.0
# A reflex that is nearly switched off says nothing of its gain, and one above this gain swings by
# itself in a compliant rig [N.m.s/rad].
LEAST_DRIVE_SHARE, LARGEST_GAIN = 0.45, 19.5
# Effects that change the drive of the reflex itself.
OF_THE_DRIVE = frozenset(
    {"reflex_threshold", "reflex_saturation", "reflex_exponent", "reflex_fading", "spindle_slack"}
)


@dataclass(frozen=True)
class Hidden:
    """Holds one effect of a recording.

    Attributes
    ----------
    id, name, equation
        Its identifier, and what it is in words and as a formula.
    strength
        In the unit of the effect.
    parameters
        Other numbers that were drawn for it, and what the engine had with it.
    share_of_torque_variance
        Variance of what it changes in that of the recorded torque [1].
    """

    id: str
    name: str
    equation: str
    strength: float
    parameters: dict[str, Any]
    share_of_torque_variance: float


@dataclass(frozen=True)
class Truth:
    """Holds all that is true of a recording.

    Attributes
    ----------
    effects
        What it hides.
    share_of_all_effects
        Of the torque's variance [1].
    subject
        The plain joint by name.
    laboratory
        Protocol, servo, voluntary torque and variation of the reflex by name.
    noise
        Standard deviation of each channel by name [rad], [rad/s], [N.m].
    quantisation
        Steps of position [rad] and torque [N.m]; None where there are none.
    anti_alias
        The filter of all channels.
    impedance
        K and G.
    shown
        Whether every effect shows and the reflex is neither off nor unstable.
    """

    effects: tuple[Hidden, ...]
    share_of_all_effects: float
    subject: dict[str, float]
    laboratory: dict[str, Any]
    noise: dict[str, float]
    quantisation: dict[str, float] | None
    anti_alias: str
    impedance: Impedance
    shown: bool

    def content(self) -> dict[str, Any]:
        """Return the truth ready for JSON."""
        return asdict(self)


@dataclass(frozen=True)
class Recorded:
    """Holds what the laboratory stores, and what is true of it.

    Attributes
    ----------
    rate
        [Hz].
    position, torque, reference
        [rad], [N.m] and the command [rad], each of shape (n,).
    velocity
        [rad/s], shape (n,); None where it is not recorded.
    truth
        Of the recording.
    """

    rate: int
    position: np.ndarray
    torque: np.ndarray
    reference: np.ndarray
    velocity: np.ndarray | None
    truth: Truth


def record(case: Case, seconds: float = SECONDS) -> Recorded:
    """Make one recording.

    Parameters
    ----------
    case
        From `draw.draw_cases`.
    seconds
        Its length [s].

    Raises
    ------
    KeyError
        An effect, a protocol or a rate of the case is unknown.
    """
    clock, protocol = Clock(case.rate, seconds), case.protocol
    for attempt in range(ATTEMPTS):
        if attempt == ATTEMPT_OF_ANOTHER_PROTOCOL:
            protocol = PROTOCOL_THAT_SHOWS_MOST
        generator = np.random.default_rng([case.seed, attempt])
        made, noise = _attempted(case, protocol, clock, generator)
        if made.is_good:
            break
    return _stored(case, made, noise, generator)


@dataclass(frozen=True)
class _Attempt:
    """Holds one laboratory with its effects at their strengths."""

    laboratory: Laboratory
    effects: list[Effect]
    strengths: list[float]
    shares: list[float]
    changes: list[Change]
    motion: Motion
    is_good: bool


def _attempted(
    case: Case, protocol: str, clock: Clock, generator: np.random.Generator
) -> tuple[_Attempt, Noise]:
    """Draw a laboratory, noise and effects, and bring the effects to their strengths."""
    laboratory = draw_laboratory(case, protocol, clock, generator)
    noise = draw_noise(clock.samples, generator)
    time = clock.time
    effects = [EFFECTS[name](generator, laboratory.subject, time) for name in case.effects]
    strengths: list[float] = []
    shares: list[float] = []
    if effects:
        wanted = draw_wanted(len(effects), generator)
        strengths, shares = found_strengths(laboratory, noise.torque, effects, wanted)
    changes = [e.change(s) for e, s in zip(effects, strengths, strict=True)]
    motion = simulated(laboratory, changes)
    torque = clock.sampled(motion.torque)
    # Without such an effect the drive is that of the subject, or its mean in time is.
    drive_share = motion.drive_share if OF_THE_DRIVE & set(case.effects) else 1.0
    is_good = (
        all(SHARES[0] <= s <= SHARES[1] for s in shares)
        and bool(np.all(np.isfinite(torque)))
        and float(torque.std()) < LARGEST_DEVIATION
        and drive_share > LEAST_DRIVE_SHARE
        and laboratory.subject.G * drive_share < LARGEST_GAIN
    )
    return _Attempt(laboratory, effects, strengths, shares, changes, motion, is_good), noise


def _stored(case: Case, made: _Attempt, noise: Noise, generator: np.random.Generator) -> Recorded:
    """Return what the sensors give, and the truth."""
    laboratory, clock = made.laboratory, made.laboratory.clock
    channels = {
        "position": clock.sampled(made.motion.plate) + noise.position,
        "torque": clock.sampled(made.motion.torque) + noise.torque,
    }
    together = 0.0
    if made.effects:
        plain = recorded_torque(laboratory, noise.torque, [], [])
        together = share(channels["torque"], plain)
    steps = draw_steps(generator) if case.quantised else None
    if steps is not None:
        channels = in_steps(channels, steps)
    truth = Truth(
        effects=tuple(
            Hidden(
                name,
                effect.name,
                effect.equation,
                strength,
                {**effect.drawn, "engine": dict(change.parameters)},
                part,
            )
            for name, effect, strength, change, part in zip(
                case.effects, made.effects, made.strengths, made.changes, made.shares, strict=True
            )
        ),
        share_of_all_effects=together,
        subject=laboratory.subject._asdict(),
        laboratory=laboratory.about,
        noise=noise.deviations,
        quantisation=steps,
        anti_alias=f"Butterworth 4, {CORNER * case.rate:.0f} Hz, all channels",
        impedance=true_impedance(laboratory, case.effects, made.changes, made.motion),
        shown=made.is_good,
    )
    velocity = clock.sampled(made.motion.velocity) + noise.velocity
    return Recorded(
        case.rate,
        channels["position"],
        channels["torque"],
        clock.sampled(laboratory.reference),
        velocity if case.velocity else None,
        truth,
    )
