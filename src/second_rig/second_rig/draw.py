"""Deals what each recording hides and under which conditions, from one seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from second_rig.drawing import evenly_in_ratio
from second_rig.effects.register import PAIRS, SINGLE, UNLISTED
from second_rig.references import REFERENCES
from second_rig.voluntary_torque import KINDS

COUNTS: Mapping[str, int] = {"base": 10, "effect": 20, "pair": 6, "unlisted": 4}
"""How many recordings of each kind a draw has unless told otherwise."""
# Rates of common laboratories [Hz].
RATES_HZ = (1000, 1024, 2000, 2048)
# A plate that gives way by a tenth of the movement of a stiff ankle, and one by a hundredth.
SERVO_STIFFNESS = (1500.0, 12000.0)
# Three servos of four give way, three recordings of four have a velocity, and every other one is
# stored in steps.
GIVES_WAY = (True, True, True, False)
HAS_VELOCITY = (False, True, True, True)
IS_QUANTISED = (False, True)
LARGEST_SEED = 2**62
Dealt = TypeVar("Dealt")


@dataclass(frozen=True)
class Case:
    """Describes one recording before it is made.

    Attributes
    ----------
    kind
        A key of `COUNTS`.
    number
        Among those of its kind.
    seed
        Of everything that is drawn when it is made.
    effects
        Identifiers of what it hides.
    protocol
        A key of `references.REFERENCES`.
    rate
        [Hz].
    voluntary
        A key of `voluntary_torque.KINDS`.
    velocity, quantised
        Whether velocity is recorded, and whether position and torque are stored in steps.
    servo_stiffness
        [N.m/rad]; None for a rigid servo.
    """

    kind: str
    number: int
    seed: int
    effects: tuple[str, ...]
    protocol: str
    rate: int
    voluntary: str
    velocity: bool
    quantised: bool
    servo_stiffness: float | None

    @property
    def name(self) -> str:
        """Return the name of the recording, unique within a draw."""
        return f"{self.kind}-{self.number:03d}-{'+'.join(self.effects) or 'nothing'}"


def draw_cases(seed: int, counts: Mapping[str, int] = COUNTS) -> list[Case]:
    """Deal the recordings of one draw; each has a seed of its own and can be made alone.

    Every condition comes as often as any other, each effect once before any comes again. One kind
    does not change another, and a larger draw begins with the recordings of a smaller one.

    Parameters
    ----------
    seed
        Of the draw.
    counts
        Recordings of each kind.

    Raises
    ------
    ValueError
        A kind is unknown.
    """
    if unknown := sorted(set(counts) - set(COUNTS)):
        raise ValueError(f"there is no kind {unknown[0]}; kinds are {', '.join(COUNTS)}")
    cases: list[Case] = []
    for place, kind in enumerate(COUNTS):
        cases += _of_kind(kind, counts.get(kind, 0), [seed, place])
    return cases


def _of_kind(kind: str, count: int, seed: list[int]) -> list[Case]:
    hidden: dict[str, Sequence[tuple[str, ...]]] = {
        "base": ((),),
        "effect": [(name,) for name in SINGLE],
        "pair": PAIRS,
        "unlisted": [(name,) for name in UNLISTED],
    }
    # Each condition is dealt from a stream of its own, so that a count changes none of the others.
    streams = [np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(7)]
    effects = _dealt(hidden[kind], count, streams[0])
    protocols = _dealt(list(REFERENCES), count, streams[1])
    rates = _dealt(RATES_HZ, count, streams[2])
    voluntary = _dealt(list(KINDS), count, streams[3])
    velocity = _dealt(HAS_VELOCITY, count, streams[4])
    quantised = _dealt(IS_QUANTISED, count, streams[5])
    gives_way = _dealt(GIVES_WAY, count, streams[6])
    cases = []
    for k in range(count):
        own = np.random.default_rng([*seed, k])
        stiffness = evenly_in_ratio(own, *SERVO_STIFFNESS) if gives_way[k] else None
        cases.append(
            Case(
                kind,
                k,
                int(own.integers(LARGEST_SEED)),
                effects[k],
                protocols[k],
                rates[k],
                voluntary[k],
                velocity[k],
                quantised[k],
                stiffness,
            )
        )
    return cases


def _dealt(values: Sequence[Dealt], count: int, generator: np.random.Generator) -> list[Dealt]:
    """Return values in random order, every one once before any comes again."""
    rounds = count // len(values) + 1
    places = [int(p) for _ in range(rounds) for p in generator.permutation(len(values))]
    return [values[place] for place in places[:count]]
