"""The reflex' responses to single movements differ in size; what that makes of the torque is found.

Where movements follow each other without rest, responses overlap, and slow torque holds them. Their
sizes are solved for together, from what is faster than slow torque:

    left(t) = sum(a_k r_k(t)) + noise,    a_k ~ N(0, USUAL_VARIATION^2)

r_k is the response of the model's reflex to movement k alone. The prior keeps a size that the data
do not tell near that of the model (ridge regression; Hoerl & Kennard 1970, Technometrics 12, 55).
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from scipy.sparse import csc_matrix, identity
from scipy.sparse.linalg import spsolve

from ankle_physics.linear_dynamics import SecondOrder
from ankle_physics.term import Values
from model_discrepancy.fit.columns import Columns
from model_discrepancy.fit.movements import find_onsets

# Of the mean size: stretch reflexes vary by 10 to 40 % (Kearney & Chan 1979).
USUAL_VARIATION = 0.3
# Mean values over so long [s] are fitted: responses hold little above 30 Hz.
_SAMPLE_S = 0.01
# The mean over so long [s] is taken off both sides, twice: what is slower is voluntary torque, of
# which 6 % is left at 0.4 Hz.
_SLOW_S = 1.0
# A response of the slowest muscle (5 rad/s, damping ratio 1) has ended after this time [s].
_LONGEST_RESPONSE_S = 1.0
# Samples of the residual that count as one observation: what a model leaves lasts 50 ms, where
# white noise would be new in each.
_SAMPLES_ALIKE = 5.0


def without_response_sizes(
    columns: Columns, values: Mapping[str, Values], left: np.ndarray
) -> np.ndarray:
    """Return what a model leaves of the torque, without what each response's own size makes of it.

    Parameters
    ----------
    columns
        Of the recording.
    values
        Of the model, by term.
    left
        Torque that it leaves [N.m], shape (n,), at the motion's rate.

    Returns
    -------
    np.ndarray
        [N.m], shape (n,); the same where the model has no reflex, or nothing moves.
    """
    responses = single_responses(columns, values)
    if not responses:
        return left
    rate = columns.motion.rate
    factor = max(round(_SAMPLE_S * rate), 1)
    window = round(_SLOW_S * rate / factor)
    fast = _without_slow(_means(left, factor), window)
    starts, entries, pointers = [], [], [0]
    for first, response in responses:
        # On the grid of the means, with room for the mean that is taken off on both sides.
        begin = first // factor
        padded = np.concatenate([np.zeros(first - begin * factor), response])
        short = _means(np.pad(padded, (0, -len(padded) % factor)), factor)
        wide = _without_slow(np.pad(short, 2 * window), window)
        rows = begin - 2 * window + np.arange(len(wide))
        inside = (rows >= 0) & (rows < len(fast))
        starts.append(rows[inside])
        entries.append(wide[inside])
        pointers.append(pointers[-1] + int(inside.sum()))
    design = csc_matrix(
        (np.concatenate(entries), np.concatenate(starts), pointers),
        shape=(len(fast), len(responses)),
    )
    noise = _SAMPLES_ALIKE * float(np.var(fast))
    normal = design.T @ design + noise / USUAL_VARIATION**2 * identity(len(responses))
    sizes = np.atleast_1d(spsolve(normal.tocsc(), design.T @ fast))
    steady = left.copy()
    for size, (first, response) in zip(sizes, responses, strict=True):
        last = min(first + len(response), len(left))
        steady[first:last] -= size * response[: last - first]
    return steady


def single_responses(
    columns: Columns, values: Mapping[str, Values]
) -> list[tuple[int, np.ndarray]]:
    """Return the first sample and the torque [N.m], shape (k,), of the response of a model's reflex
    to each single movement that stretches the calf.

    Parameters
    ----------
    columns
        Of the recording.
    values
        Of the model, by term; of the reflex ``G`` [N.m.s/rad], ``delay`` [s], ``omega`` [rad/s] and
        the damping ratio ``z`` [1].
    """
    reflex = values.get("reflex")
    if reflex is None or reflex["G"] <= 0.0:
        return []
    motion = columns.motion
    gain, omega, damping = (float(reflex[symbol]) for symbol in ("G", "omega", "z"))
    delay = round(float(reflex["delay"]) * motion.rate)
    onsets = np.round(find_onsets(columns).time * motion.rate).astype(int)
    drive = gain * np.maximum(motion.velocity, 0.0)
    longest = round(_LONGEST_RESPONSE_S * motion.rate)
    found = []
    for begin, end in pairwise([*onsets, len(drive)]):
        alone = np.pad(drive[begin : min(end, begin + longest)], (0, longest))
        response = SecondOrder(motion.rate).run(alone, omega, damping)
        if begin + delay < len(drive) and np.any(response):
            found.append((int(begin) + delay, response))
    return found


def _means(signal: np.ndarray, factor: int) -> np.ndarray:
    """Return means over so many samples; a rest at the end is left out."""
    count = len(signal) // factor
    return np.asarray(signal[: count * factor].reshape(count, factor).mean(axis=1))


def _without_slow(signal: np.ndarray, window: int) -> np.ndarray:
    """Return a signal without its mean over so many samples around each, taken off twice; shape
    (n,).
    """
    index = np.arange(len(signal))
    first = np.maximum(index - window // 2, 0)
    last = np.minimum(index + window // 2 + 1, len(signal))
    fast = signal
    for _ in range(2):
        summed = np.concatenate([[0.0], np.cumsum(fast)])
        fast = fast - (summed[last] - summed[first]) / (last - first)
    return np.asarray(fast)
