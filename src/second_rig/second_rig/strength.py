"""Brings each effect of a recording to the share of the torque's variance that it is to have."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from second_rig.drawing import evenly_in_ratio
from second_rig.effects.effect import Effect
from second_rig.laboratory import Laboratory, simulated

# Share of the torque's variance that an effect is to change, alone and beside another.
WANTED_ALONE, WANTED_IN_A_PAIR = (0.010, 0.10), (0.010, 0.06)
# Close enough, as the logarithm of a ratio: a sixth of the share.
CLOSE = 0.15
ROUNDS = 7
# Within these ratios a share goes about with the square of the strength; outside, the strength is
# changed by a factor of three.
QUADRATIC = (0.02, 50.0)
UP, DOWN = 3.0, 0.33
# Keeps a ratio defined where an effect changes nothing at all.
LEAST_SHARE = 1e-9


def draw_wanted(count: int, generator: np.random.Generator) -> list[float]:
    """Draw the share of the torque's variance that each effect is to have [1].

    Parameters
    ----------
    count
        Effects of the recording.
    generator
        Draws them.
    """
    limits = WANTED_ALONE if count == 1 else WANTED_IN_A_PAIR
    return [evenly_in_ratio(generator, *limits) for _ in range(count)]


def recorded_torque(
    laboratory: Laboratory, noise: np.ndarray, effects: Sequence[Effect], strengths: Sequence[float]
) -> np.ndarray:
    """Return the torque as it is recorded with some effects [N.m], shape (n,).

    Parameters
    ----------
    laboratory
        Without any.
    noise
        Of the torque [N.m], shape (n,).
    effects, strengths
        Of the same number.
    """
    changes = [e.change(s) for e, s in zip(effects, strengths, strict=True)]
    return laboratory.clock.sampled(simulated(laboratory, changes).torque) + noise


def share(with_it: np.ndarray, without: np.ndarray) -> float:
    """Return the variance of what an effect changes in that of the torque [1].

    Parameters
    ----------
    with_it, without
        Torque with and without the effect [N.m], each of shape (n,).
    """
    return float(np.var(with_it - without) / np.var(with_it))


def found_strengths(
    laboratory: Laboratory, noise: np.ndarray, effects: Sequence[Effect], wanted: Sequence[float]
) -> tuple[list[float], list[float]]:
    """Return the strength of each effect, and the share of the torque's variance that it reached.

    The share of an effect is that of the recording with all effects against the one without it.

    Parameters
    ----------
    laboratory
        Without any effect.
    noise
        Of the torque [N.m], shape (n,).
    effects, wanted
        Of the same number, at least one.
    """
    strengths = [effect.start for effect in effects]
    plain = recorded_torque(laboratory, noise, [], [])
    for number in range(ROUNDS):
        torque = recorded_torque(laboratory, noise, effects, strengths)
        shares = []
        for place in range(len(effects)):
            others = [j for j in range(len(effects)) if j != place]
            without = (
                recorded_torque(
                    laboratory, noise, [effects[j] for j in others], [strengths[j] for j in others]
                )
                if others
                else plain
            )
            shares.append(share(torque, without))
        ratios = [s / w for s, w in zip(shares, wanted, strict=True)]
        if number == ROUNDS - 1 or all(abs(np.log(max(r, LEAST_SHARE))) < CLOSE for r in ratios):
            break
        following = [
            _next(effect, strength, ratio)
            for effect, strength, ratio in zip(effects, strengths, ratios, strict=True)
        ]
        if np.allclose(following, strengths, rtol=1e-3):
            break
        strengths = following
    return strengths, shares


def _next(effect: Effect, strength: float, ratio: float) -> float:
    """Return the strength to be tried next, from the share in units of the wanted one."""
    if QUADRATIC[0] < ratio < QUADRATIC[1]:
        factor = float(1.0 / np.sqrt(ratio))
    else:
        factor = UP if ratio < 1.0 else DOWN
    return float(np.clip(strength * factor, effect.weakest, effect.strongest))
