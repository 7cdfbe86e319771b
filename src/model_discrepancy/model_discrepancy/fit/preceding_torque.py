"""What the muscles held just before each movement.

Slow torque holds a part of every response to a movement. Where responses vary from stretch to
stretch, a term that follows slow torque seems to predict them, because it follows the very response
that it predicts. What was held before a movement began holds nothing of its response.

Where movements follow each other without rest, that holds the responses to the movements before,
and their sizes. What the sizes make of the torque is taken off first (`response_sizes`). Where most
movements do, the window holds two or three of these responses.
"""

from __future__ import annotations

import numpy as np

from model_discrepancy.fit.columns import Columns
from model_discrepancy.fit.movements import find_onsets

# Voluntary torque changes within a second or two; a shorter window would hold more tremor and
# sensor noise. Windows of 0.15 and 0.35 s tell the same.
WINDOW_S = 0.25
# Smoothing of position and torque lets a movement begin a few milliseconds too early.
GUARD_S = 0.01
# Movements that follow each other faster, half of them at least, leave no rest for the window: what
# was held before one is the response to the one before. Binary sequences (0.2 s) and the human
# trials (0.25 s) do; random levels (0.35 s), steps (0.4 s) and pulses (0.6 s) do not.
SHORTEST_REST_S = WINDOW_S + 0.05
# There a longer window takes the mean of what two or three responses leave of the torque. One that
# is longer still, or ends earlier, tells less, since voluntary torque changes within a second or
# two: on the independent rig with binary sequences the second that ended 0.35 s before a movement
# confirmed 1 of 14 effects that follow torque, this window 13.
RESTLESS_WINDOW_S = 0.6
# Of the mean power of the share of the torque that is shown: a window with less tells nothing.
LEAST_POWER = 0.25
# Of a continuous movement only a few moments come after a rest.
MIN_MOVEMENTS = 20


def begins_from_rest(columns: Columns, most: float = 0.5) -> bool:
    """Say whether what was held just before a movement holds little of the last response.

    Parameters
    ----------
    columns
        Of the recording.
    most
        Share of the movements that come after a rest at least, 0...1.
    """
    return _rest(find_onsets(columns).time, most)


def _rest(times: np.ndarray, most: float = 0.5) -> bool:
    """Return whether so many of the movements that begin at these times [s] come after a rest."""
    return len(times) > 1 and float(np.quantile(np.diff(times), 1.0 - most)) > SHORTEST_REST_S


def is_continuous(columns: Columns) -> bool:
    """Say whether the plate hardly ever begins to move from rest: it moves all the time.

    Parameters
    ----------
    columns
        Of the recording.
    """
    return len(find_onsets(columns).time) < MIN_MOVEMENTS


def preceding_torque(
    columns: Columns, left: np.ndarray, shown: np.ndarray | None = None
) -> np.ndarray | None:
    """Return the torque that the muscles held before the movement under way.

    Parameters
    ----------
    columns
        Of the recording.
    left
        What the base model leaves of the torque [N.m], shape (n,), at the motion's rate; where
        some movements do not begin from rest, without what the sizes of responses make of it.
    shown
        Share of the torque that the joint shows [1], shape (n,); None: all of it.

    Returns
    -------
    np.ndarray | None
        [N.m], shape (n,), constant from one movement to the next; None where there are too few
        movements.
    """
    times = find_onsets(columns).time
    if len(times) < MIN_MOVEMENTS:
        return None
    motion = columns.motion
    onsets = np.round(times * motion.rate).astype(int)
    seconds = WINDOW_S if _rest(times) else RESTLESS_WINDOW_S
    window, guard = (round(s * motion.rate) for s in (seconds, GUARD_S))
    ends = np.maximum(onsets - guard, 1)
    begins = np.maximum(ends - window, 0)

    def mean(signal: np.ndarray) -> np.ndarray:
        summed = np.concatenate([[0.0], np.cumsum(signal)])
        return np.asarray((summed[ends] - summed[begins]) / (ends - begins))

    if shown is None:
        before = mean(left)
    else:
        power = mean(shown**2)
        before = mean(left * shown) / np.maximum(power, LEAST_POWER * np.mean(power))
    under_way = np.searchsorted(onsets, np.arange(len(left)), side="right")
    held = np.concatenate([[0.0], before])[under_way]
    return np.asarray(float(np.mean(motion.torque)) + held)
