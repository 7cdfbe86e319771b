"""The memory is the longest one whose parameters predict as well as any other's.

A slow change never stands out between two parts of the memory (`change_detection`); it shows in
that older data predict worse. And an ankle that changes back and forth faster than it can be
followed is predicted best by its mean. So several memories each solve for the parameters, these
predict the torque of the half second that follows, and the running likelihoods of their predictions
are compared (prequential choice of a model: Dawid, J. R. Stat. Soc. A 147 (1984) 278-292). The
memories, in the order of preference:

- the full memory, but not from before a change;
- a half, a quarter, ... of it;
- the full memory across every change that was detected.

Their parameters at the beginning of the half second are computed one memory a block, so that no
block has all the work.
"""

from __future__ import annotations

import numpy as np

from impedance_estimator.compilation import part
from impedance_estimator.simultaneous.block_update import (
    LIKELIHOOD_MEMORY,
    MIN_REPEATED_LOG_LIKELIHOOD_GAIN,
    solve_memory,
)
from impedance_estimator.simultaneous.change_detection import SHORTEST_WINDOW
from impedance_estimator.simultaneous.memory import (
    blocks_of,
    normal_matrix,
    recent_sums,
    use_chosen_memory,
)
from impedance_estimator.simultaneous.regression import PARAMETERS
from impedance_estimator.simultaneous.state import Plan, State

SHORTEST_MEMORY = 1.25
"""The shortest memory [s] holds about two perturbations: fewer do not tell stiffness from reflex.
"""
PREDICTION_TIME = 0.5
"""Torque is predicted over so long [s]: most of a response to a perturbation.

With 1 s, an ankle that swings at 0.2 Hz is no longer followed.
"""
LARGEST_DISPERSION = 50.0
"""The scatter of the scores slows the choice down by at most this factor: a reflex that varies by
20 % from stretch to stretch gives 10 to 30; more is the drift, for which the memory is too long.
"""


def memory_lengths(seconds: float, block: float, changes: bool) -> np.ndarray:
    """Return the lengths in blocks, falling from the full memory by factors of two; only the full
    one without `changes`; shape (k,).
    """
    lengths = [seconds]
    while changes and lengths[-1] / 2.0 >= SHORTEST_MEMORY:
        lengths.append(lengths[-1] / 2.0)
    return np.array([max(round(length / block), 1) for length in lengths])


@part
def ask_memory(p: Plan, s: State, candidate: int, after: int) -> None:
    """Ask one memory, as it was `after` blocks ago, for its parameters; one shorter than a response
    has those that are estimated now.
    """
    blocks = blocks_of(p, s, candidate) - after
    c = s.counters[0]
    if candidate == p.lengths.shape[0] and c.since == c.kept and not c.changed:
        # Nothing was taken for a change: this is the full memory, which was asked first.
        s.predictors[candidate] = s.predictors[0]
        return
    solution = s.solution.copy()
    if blocks >= SHORTEST_WINDOW:
        normal = normal_matrix(s, c.detection, blocks, after)
        covariance = np.empty((PARAMETERS, PARAMETERS))
        if np.isnan(solve_memory(p, s, normal, blocks, solution, covariance)):
            solution[:] = s.solution
    predictor = s.predictors[candidate]
    predictor[:] = s.nuisance.unknowns[PARAMETERS]
    for i in range(PARAMETERS):
        for k in range(predictor.shape[0]):
            predictor[k] += solution[i] * s.nuisance.unknowns[i, k]


@part
def choose_memory(p: Plan, s: State) -> None:
    """Score the predictions of the last half second, and use the memory that they favour."""
    c = s.counters[0]
    if c.kept < 2 * p.horizon:
        # They were asked before there was anything to tell.
        return
    recorded = recent_sums(s, c.detection, p.horizon, 0)
    count = p.horizon * p.block_samples
    for candidate in range(s.predictors.shape[0]):
        # Some were asked before a change, some after it: that is no difference between them.
        w = s.predictors[0 if c.changed and candidate < p.lengths.shape[0] else candidate]
        # Z'Z, Z'τ and τ'τ in the order of `nuisance.accumulate`.
        squares, k = recorded[-1], 0
        with_torque = recorded.shape[0] - 1 - w.shape[0]
        for i in range(w.shape[0]):
            squares += recorded[k] * w[i] * w[i] - 2.0 * recorded[with_torque + i] * w[i]
            k += 1
            for j in range(i + 1, w.shape[0]):
                squares += 2.0 * recorded[k] * w[i] * w[j]
                k += 1
        s.predicted[candidate] *= 1.0 - p.horizon / p.second / LIKELIHOOD_MEMORY
        if squares > 0.0:
            s.predicted[candidate] -= 0.5 * count * np.log(squares / count)
    c.changed = 0
    chosen = 0
    margin = MIN_REPEATED_LOG_LIKELIHOOD_GAIN * min(c.dispersion, LARGEST_DISPERSION)
    while s.predicted[chosen] < np.max(s.predicted) - margin:
        chosen += 1
    if chosen != c.memory:
        c.memory = chosen
        use_chosen_memory(p, s)
