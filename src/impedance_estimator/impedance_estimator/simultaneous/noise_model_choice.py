"""The corner of the noise model is chosen once a second.

The whole memory is solved under every corner, and the lowest one is used that costs little: behind
a higher corner K and G are extrapolated by the model's own form (`voluntary_torque_noise`).
"""

from __future__ import annotations

import numpy as np

from impedance_estimator.compilation import part
from impedance_estimator.simultaneous.block_update import solve_memory
from impedance_estimator.simultaneous.doubt import structural_doubt
from impedance_estimator.simultaneous.memory import normal_matrix
from impedance_estimator.simultaneous.regression import GAINS, PARAMETERS
from impedance_estimator.simultaneous.state import Plan, State
from impedance_estimator.simultaneous.voluntary_torque_noise import LOW_CORNER, MIDDLE_CORNER

K_AND_G = (0, GAINS - 1)
"""Places of K and G among the gains."""
LARGEST_ERROR_RATIO = 2.0
"""The lowest corner is used under which the standard errors of K and G are at most this many times
the smallest under any: its estimate is less biased by what the model leaves out, but voluntary
torque spoils it sooner."""
LARGEST_DOUBTED_RATIO = 3.0
"""So many times in full doubt that the model holds: beside what it leaves out a smaller standard
error is worth less. On two real ankles the ratio is up to 2.2. Without a mismatch, in noise that
hides the slow part of a response, it is 3.1 and more."""
ERROR_RATIO_HYSTERESIS = 1.3
"""The present corner is kept up to a ratio larger, another one taken from a ratio smaller by this
factor, so that the choice does not flicker."""
LOW_CORNER_DURATION = 6.0
"""A memory of at least this length [s] may be whitened with the low corner, whose filter remembers
a step of torque for about a second."""
BATCH_DURATION = 2
"""A batch of scores lasts so many seconds."""
SCATTER_MEMORY = 60.0
"""The running mean of the scores' scatter remembers so many seconds; its own error is then 20 %."""


@part
def compare_noise_models(p: Plan, s: State) -> None:
    """Return the estimates and standard errors of the whole memory under every noise model, and the
    scatter of their scores.
    """
    c = s.counters[0]
    weight = 1.0 / min(c.batches + 1.0, SCATTER_MEMORY)
    solution, covariance = np.empty(PARAMETERS), np.empty((PARAMETERS, PARAMETERS))
    for model in range(s.ring.shape[0]):
        normal = normal_matrix(s, model, c.length, 0)
        variance = solve_memory(p, s, normal, c.length, solution, covariance)
        if not np.isfinite(variance):
            continue
        _watch_scatter(p, s, model, solution, covariance, variance, weight)
        for i in range(GAINS):
            s.compared[model, 0, i] = solution[i]
            s.compared[model, 1, i] = variance * max(s.scatter[model, i], 1.0) * covariance[i, i]
    c.batches += 1
    c.dispersion = max(np.mean(s.scatter[c.detection]), 1.0)


@part
def choose_noise_model(p: Plan, s: State) -> None:
    """Choose by the standard errors of K and G (`lowest_corner`); the low corner only with a memory
    that is long enough.
    """
    c = s.counters[0]
    short = c.unsettled or c.length < LOW_CORNER_DURATION * p.second
    first = MIDDLE_CORNER if short else LOW_CORNER
    c.model = lowest_corner(s.compared, structural_doubt(s), first, c.model, c.detection)
    c.detection = max(c.model, MIDDLE_CORNER)


@part
def lowest_corner(
    compared: np.ndarray, doubt: float, first: int, present: int, otherwise: int
) -> int:
    """Return the lowest corner whose standard errors of K and G are not much larger than those
    under another; where none is, the one with the smallest errors.

    Parameters
    ----------
    compared
        Gains and their variances under every corner, shape (models, 2, gains).
    doubt
        Doubt that the model holds, 0 to 1.
    first
        The lowest corner that may be chosen.
    present
        The corner in use; it stays in use up to a larger ratio.
    otherwise
        The result where nothing was compared yet.
    """
    largest = LARGEST_ERROR_RATIO + doubt * (LARGEST_DOUBTED_RATIO - LARGEST_ERROR_RATIO)
    least, best = np.inf, otherwise
    for model in range(first, compared.shape[0]):
        ratio = 1.0
        for i in K_AND_G:
            smallest = np.min(compared[:, 1, i])
            if smallest > 0.0:
                ratio = max(ratio, np.sqrt(compared[model, 1, i] / smallest))
        ratio /= ERROR_RATIO_HYSTERESIS if model == present else 1.0 / ERROR_RATIO_HYSTERESIS
        if ratio < least:
            least, best = ratio, model
        if ratio < largest:
            return model
    return best


@part
def _watch_scatter(
    p: Plan,
    s: State,
    model: int,
    solution: np.ndarray,
    covariance: np.ndarray,
    variance: float,
    weight: float,
) -> None:
    """Update the factors that widen the standard errors: the squared scores of the last batch over
    what white noise would give.
    """
    influence, fitted = np.empty(PARAMETERS), np.empty(PARAMETERS)
    normal = normal_matrix(s, model, BATCH_DURATION * p.second, 0)
    for output in range(GAINS):
        # influence = C weights: what one unit of score does to the output.
        for i in range(PARAMETERS):
            influence[i] = covariance[i, output]
        observed = expected = 0.0
        for i in range(PARAMETERS):
            score, total = normal[i, PARAMETERS], 0.0
            for j in range(PARAMETERS):
                score -= normal[i, j] * solution[j]
                total += normal[i, j] * influence[j]
            observed += influence[i] * score
            expected += influence[i] * total
            fitted[i] = total
        # The fit has already taken part of the scores: their variance is N - N C N.
        for i in range(PARAMETERS):
            for j in range(PARAMETERS):
                expected -= fitted[i] * covariance[i, j] * fitted[j]
        ratio = observed * observed / (variance * expected) if expected > 0.0 else 1.0
        s.scatter[model, output] += weight * (ratio - s.scatter[model, output])
