"""The moment at which the ankle changed is found by a generalised likelihood ratio.

It compares the recent part of the memory with the older one.

For every candidate window at the end of the memory, are K, B, I and G the same within it as before
it?

    D = min_θ [Q_old(θ) + Q_recent(θ)] - min_θ Q_old(θ) - min_θ Q_recent(θ)

Q is the squared residual over the noise variance. Without a change D is chi-square distributed with
four degrees of freedom. Where the largest D of all windows passes a threshold, everything before
that window is forgotten (Willsky & Jones, IEEE Trans. Autom. Control 21 (1976) 108-112). Between
changes the memory grows to its full length, so precision and speed are not traded against each
other.

A change is found from few data, and may so be placed a little early. While the memory grows again,
the test is therefore also made for its first few blocks alone, with the noise of all that came
after them; no more than those are given up.
"""

from __future__ import annotations

import numpy as np

from impedance_estimator.compilation import part
from impedance_estimator.simultaneous.memory import add_blocks
from impedance_estimator.simultaneous.nuisance import reduce_sums, reducible_size
from impedance_estimator.simultaneous.regression import (
    GAINS,
    solve_with_prior,
    squared_residual,
)

SHORTEST_WINDOW = 6
"""The shortest window has so many blocks: 0.4 s, the length of a reflex response."""
MIN_OLDER_BLOCKS = 16
"""So many blocks must be left before the window: 1 s, one or two perturbations."""
OVERLAP_BLOCKS = (12, 8, 5, 3, 2, 1)
"""So many blocks from before a change may remain in the memory when the change was placed a little
too early, the most first: 0.75 s in all. They are looked for until the memory is full: so short a
part would otherwise pull the estimate for as long as the memory lasts.
"""
WINDOW_RATIO = 1.4
"""The length of a window is this ratio times that of the one before."""
SHORT_WINDOW_PERIOD, LONG_WINDOW_PERIOD = 2, 4
"""Windows of up to `LONGEST_SHORT_WINDOW` are looked at after so many blocks (1/8 s); longer ones,
and what a change may have left over, after so many (1/4 s). After every block it would be twice the
work, and the shortest window is 0.4 s long.
"""
LONGEST_SHORT_WINDOW = 32
"""A short window has at most so many blocks: 2 s."""


def candidate_windows(longest: int) -> np.ndarray:
    """Return the lengths of the windows in blocks, shape (k,).

    They are geometric, from `SHORTEST_WINDOW` to less than `longest`.
    """
    windows = [SHORTEST_WINDOW]
    while windows[-1] * WINDOW_RATIO < longest - MIN_OLDER_BLOCKS:
        windows.append(round(windows[-1] * WINDOW_RATIO))
    return np.array(windows)


@part
def split_statistic(
    recent: np.ndarray,
    older: np.ndarray,
    together: np.ndarray,
    precision: np.ndarray,
    variance: float,
) -> float:
    """Return D for one split.

    Parameters
    ----------
    recent, older
        Normal matrices of both parts, shape (n, n).
    together
        K, B, I, G of both parts together, shape (>= 4,).
    precision
        Of the prior around `together` that keeps short windows solvable, over the noise variance,
        shape (4,).
    variance
        Of the noise [N²m²].
    """
    solution, covariance = np.empty(GAINS), np.empty((GAINS, GAINS))
    before = squared_residual(recent, GAINS, together) + squared_residual(older, GAINS, together)
    after = 0.0
    for stretch in (recent, older):
        if np.isnan(solve_with_prior(stretch, GAINS, precision, together, solution, covariance)):
            return 0.0
        after += squared_residual(stretch, GAINS, solution)
        for i in range(GAINS):
            after += precision[i] * (solution[i] - together[i]) ** 2
    return (before - after) / variance


@part
def find_change(
    ring: np.ndarray,
    newest: int,
    length: int,
    left_over: int,
    windows: np.ndarray,
    total: np.ndarray,
    precision: np.ndarray,
    samples: int,
    unknowns: np.ndarray,
) -> tuple[int, float, float]:
    """Find the window with the largest D, that D, and the noise variance beside it; zeros where the
    memory is too short.

    Parameters
    ----------
    ring
        Sums of every block, shape (capacity, k), as `nuisance.accumulate` makes them.
    newest
        Index of the newest block in the ring.
    length
        Blocks in the memory.
    left_over
        Blocks at the beginning of the memory, at most, that may be from before the last change.
    windows
        Lengths of the candidate windows [blocks], rising.
    total
        Normal matrix of the whole memory, shape (n, n).
    precision
        Shape (4,), 1 / (widest jump)² of K, B, I, G.
    samples
        Number of decimated samples in one block.
    unknowns
        Signals of the regression as combinations of the recorded ones, `combine` of
        `nuisance.reduce_sums`.
    """
    best, largest, noise = 0, 0.0, 0.0
    recent, older = np.empty_like(total), np.empty_like(total)
    together, solution, covariance = np.empty(GAINS), np.empty(GAINS), np.empty((GAINS, GAINS))
    prior = np.full(GAINS, 1e-12)
    if np.isnan(solve_with_prior(total, GAINS, prior, prior, together, covariance)):
        return best, largest, noise
    sums = np.zeros(reducible_size(unknowns.shape[1]))
    taken = 0
    grown = 0
    while grown < windows.shape[0] and length - windows[grown] >= MIN_OLDER_BLOCKS:
        grown += 1
    for candidate in range(grown + len(OVERLAP_BLOCKS)):
        if candidate < grown:
            window = windows[candidate]
        elif OVERLAP_BLOCKS[candidate - grown] <= left_over:
            window = length - OVERLAP_BLOCKS[candidate - grown]
        else:
            continue
        if window < SHORTEST_WINDOW:
            continue
        if taken < window:
            add_blocks(sums, ring, newest, taken, window)
            taken = window
        reduce_sums(sums, unknowns, recent)
        for i in range(total.shape[0]):
            for j in range(total.shape[0]):
                older[i, j] = total[i, j] - recent[i, j]
        # One part alone gives the noise, the longer one of an early or late change: a change never
        # enlarges it.
        prior[:] = 1e-12
        reference, blocks = (older, length - window) if candidate < grown else (recent, window)
        if np.isnan(solve_with_prior(reference, GAINS, prior, prior, solution, covariance)):
            continue
        variance = squared_residual(reference, GAINS, solution) / (blocks * samples)
        if not variance > 0.0:
            continue
        for i in range(GAINS):
            prior[i] = variance * precision[i]
        d = split_statistic(recent, older, together, prior, variance)
        if d > largest:
            best, largest, noise = window, d, variance
    return best, largest, noise
