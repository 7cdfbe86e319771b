"""Recordings of the robustness study: effects, strengths, servos, subjects, jumps."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from blind_rig import effects
from blind_rig.magnitudes import MAGNITUDES, brought_in
from blind_rig.protocols import Protocol
from blind_rig.strength import STRENGTHS
from blind_rig.subjects import FORCE_FLUCTUATION, OPERATING_ANGLE, SAMPLING_RATES, draw_subject
from blind_rig.trial import Trial

STREAM = 53
"""Labels the seeds of this study, so that they are not those of any other."""
NO_MISMATCH, JUMP = "no mismatch", "jump"
SERVOS = {"stiff": 0.0, "compliant": 2500.0}
"""Stiffness of the servo against load [N.m/rad], 0 is rigid; 2000 to 3000 is what real rigs show:
the plate holds 0.93 to 0.97 of the command against an ankle of 100 N.m/rad.
"""
VARIATIONS = (0.1, 0.2, 0.3)
"""Standard deviation of the reflex from stretch to stretch [1]: 10 to 30 % in healthy subjects."""
USUAL_VARIATION = 0.2
JUMP_VARIATION = 0.25
VOLUNTARY_TORQUES = {
    "1/f": "courses.pink_rms",
    "steps": "courses.steps_rms",
    "ramps": "courses.ramps_rms",
    "bursts": "courses.bursts_peak",
}
"""Kinds of voluntary torque; none is filtered white noise, which estimators assume."""
BURST_SIZE = 3.0
"""Peak of a burst over the rms of the other kinds: bursts are rare."""
TREMOR = 0.05
"""[N.m] rms, physiological tremor of a steady contraction."""
JUMPS = ((1.2, 1.0), (3.0, 1.0), (1.0, 1.4), (1.0, 3.0))
"""Factors on K and G: 20 % and threefold, 40 % and threefold."""
JUMP_START = {"muscle.K": (45.0, 60.0), "reflex.G": (4.0, 6.0)}
"""Before a jump K and G lie in these ranges [N.m/rad], [N.m.s/rad]: three times as much is still an
ankle.
"""
QUICK_EFFECTS = (
    "strap",
    "bearing_friction",
    "soft_shaft",
    "torque_sensor_mode",
    "torque_delay",
    "torque_lag",
    "encoder_backlash",
    "maxwell",
    "short_range_stiffness",
    "hardening",
    "tendon",
    "reflex_exponent",
    "antagonist_reflex",
    "length_reflex",
)


@dataclass(frozen=True)
class Size:
    """Describes how large a study is.

    Attributes
    ----------
    seconds
        Length of a recording.
    nulls
        Recordings without mismatch of each kind of voluntary torque, variation and servo.
    effects
        Names.
    strengths
        Of each effect.
    jumps
        Recordings of each jump.
    runs
        Recordings of each effect and strength, of different subjects.
    """

    seconds: float
    nulls: int
    effects: tuple[str, ...]
    strengths: tuple[str, ...]
    jumps: int
    runs: int = 1

    def repeated(self, times: int) -> Size:
        """Return a size with so many times the recordings of each kind."""
        return replace(
            self,
            nulls=times * self.nulls,
            jumps=times * self.jumps,
            runs=times * self.runs,
        )


FULL_SIZE = Size(120.0, 1, tuple(MAGNITUDES), tuple(STRENGTHS), 6)
QUICK_SIZE = Size(60.0, 0, QUICK_EFFECTS, ("moderate",), 1)
QUICK_NULLS = 6


@dataclass(frozen=True)
class Condition:
    """Describes the conditions of one recording.

    Attributes
    ----------
    name
        Unique; names the files of the recording and of its result.
    effect
        Name in `blind_rig.effects`, or `NO_MISMATCH`, or `JUMP`.
    strength
        Of the effect; empty without one.
    servo
        A key of `SERVOS`.
    voluntary
        A key of `VOLUNTARY_TORQUES`.
    variation
        Of the reflex from stretch to stretch [1].
    jump
        Factors on K and G in the middle of the recording.
    seed
        Of subject, perturbation, courses and noise.
    seconds
        Length.
    """

    name: str
    effect: str
    strength: str
    servo: str
    voluntary: str
    variation: float
    jump: tuple[float, float]
    seed: int
    seconds: float

    @property
    def jump_time(self) -> float:
        """Return the time of the jump [s]."""
        return 0.5 * self.seconds

    def as_content(self) -> dict[str, Any]:
        """Return the condition as content for JSON."""
        return asdict(self)


def conditions(size: Size, seed: int) -> list[Condition]:
    """Return all recordings of a study; the same for the same size and seed.

    Parameters
    ----------
    size
        `FULL_SIZE`, `QUICK_SIZE` or another.
    seed
        Seed of the study.
    """
    random = np.random.default_rng([STREAM, seed])
    kinds, servos = list(VOLUNTARY_TORQUES), list(SERVOS)

    def fresh() -> int:
        return int(random.integers(2**62))

    found = []
    nulls = list(product(kinds, VARIATIONS, servos, range(size.nulls)))
    if not nulls:
        nulls = [(kinds[k % 4], VARIATIONS[k % 3], servos[k % 2], 0) for k in range(QUICK_NULLS)]
    for kind, variation, servo, run in nulls:
        name = f"null_{kind.replace('/', '_')}_{variation:g}_{servo}_{run}"
        found.append(
            Condition(
                name, NO_MISMATCH, "", servo, kind, variation, (1.0, 1.0), fresh(), size.seconds
            )
        )
    kinds_of_effects = list(product(size.effects, size.strengths))
    for run, (number, (effect, strength)) in product(range(size.runs), enumerate(kinds_of_effects)):
        found.append(
            Condition(
                f"{effect}_{strength}" + (f"_{run}" if run else ""),
                effect,
                strength,
                servos[(number + run) % 2],
                kinds[(number + number // 4 + run) % 4],
                USUAL_VARIATION,
                (1.0, 1.0),
                fresh(),
                size.seconds,
            )
        )
    for jump, run in product(JUMPS, range(size.jumps)):
        found.append(
            Condition(
                f"jump_{jump[0]:g}_{jump[1]:g}_{run}",
                JUMP,
                "",
                servos[run % 2],
                kinds[run % 4],
                JUMP_VARIATION,
                jump,
                fresh(),
                size.seconds,
            )
        )
    return found


def in_drawn_order(planned: list[Condition], seed: int) -> list[Condition]:
    """Return the recordings in an order drawn by the seed, so that the first of them are a fair
    sample.
    """
    order = np.random.default_rng([STREAM, seed, 1]).permutation(len(planned))
    return [planned[k] for k in order]


def blind_trial(condition: Condition) -> Trial:
    """Return the trial of the independent rig that a condition describes."""
    random = np.random.default_rng(condition.seed)
    setup = draw_subject(random)
    level = setup.courses.torque_level
    steadiness = level * float(random.uniform(*FORCE_FLUCTUATION))
    peak = BURST_SIZE if condition.voluntary == "bursts" else 1.0
    changes = {
        "courses.voluntary_rms": 0.0,
        VOLUNTARY_TORQUES[condition.voluntary]: peak * steadiness,
        "courses.tremor_rms": TREMOR,
        "courses.stretch_variation": condition.variation,
        "rig.servo_k": SERVOS[condition.servo],
    }
    if condition.effect == JUMP:
        changes |= {path: float(random.uniform(*limits)) for path, limits in JUMP_START.items()}
        changes |= {
            "courses.jump_at": condition.jump_time,
            "courses.jump_muscle": condition.jump[0],
            "courses.jump_reflex": condition.jump[1],
        }
    known = effects.EFFECTS_BY_NAME.get(condition.effect)
    kind = known.protocols[0] if known is not None and known.protocols else "pulse_step"
    trial = Trial(
        setup.replaced(changes),
        Protocol(kind, float(random.uniform(0.03, 0.05)), 0.024, condition.seconds),
        float(random.choice(SAMPLING_RATES)),
        float(random.uniform(*OPERATING_ANGLE)),
        condition.seed,
    )
    return trial if known is None else brought_in(trial, condition.effect, condition.strength)
