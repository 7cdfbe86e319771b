"""How often the interval holds the true correlation: the whole way from absolute values, through
z-scores, to the bootstrap.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from session_analysis.correlation import correlate, z_scores


def coverage(
    r: float,
    holds: Sequence[int],
    trials: int,
    resamples: int,
    seed: int,
    progress: Callable[[float], None] | None = None,
) -> float:
    """Return the share of synthetic studies whose 95 % interval holds the true correlation.

    Every study draws Gaussian pairs with correlation r for each subject, gives each subject a slope
    and an intercept of their own, and is analysed as recorded ones are.

    Parameters
    ----------
    r
        True correlation within subjects, -1 to 1.
    holds
        Number of holds of each subject.
    trials
        Number of studies.
    resamples
        Number of resamples of each bootstrap.
    seed
        Seed of all that is random.
    progress
        Called with the fraction done.
    """
    random = np.random.default_rng(seed)
    groups = np.repeat(np.arange(len(holds)), holds)
    held = 0
    for trial in range(trials):
        x, y = random.multivariate_normal([0.0, 0.0], [[1.0, r], [r, 1.0]], len(groups)).T
        slopes, intercepts = (
            random.uniform(0.5, 2.0, len(holds)),
            random.normal(0.0, 3.0, len(holds)),
        )
        found = correlate(
            z_scores(x, groups),
            z_scores(slopes[groups] * y + intercepts[groups], groups),
            trial,
            resamples,
        )
        held += found.low <= r <= found.high
        if progress is not None:
            progress((trial + 1) / trials)
    return held / trials
