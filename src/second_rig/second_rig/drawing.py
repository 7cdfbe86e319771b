"""Numbers drawn from a range: evenly, or evenly in their logarithm."""

from __future__ import annotations

import numpy as np


def evenly(generator: np.random.Generator, low: float, high: float) -> float:
    """Return a number between two others.

    Parameters
    ----------
    generator
        Draws it.
    low, high
        The range.
    """
    return float(generator.uniform(low, high))


def evenly_in_ratio(generator: np.random.Generator, low: float, high: float) -> float:
    """Return a number between two others, every ratio as likely.

    Parameters
    ----------
    generator
        Draws it.
    low, high
        The range, above zero.
    """
    return float(np.exp(generator.uniform(np.log(low), np.log(high))))


def either_sign(generator: np.random.Generator) -> int:
    """Return -1 or 1.

    Parameters
    ----------
    generator
        Draws it.
    """
    return int(generator.choice([-1, 1]))
