"""The steps in which a coarse channel gives its values.

Values that lie at equal distances show as a comb in their histogram, and a comb's spectrum (the
values' characteristic function) has a peak at one over the distance. Noise that was added later
widens the comb's teeth and lowers the peak. Levels of a protocol have peaks, too, but the lowest of
them is the highest. And where a torque rests at a few levels, as behind friction in a binary
sequence, its way from one to the next passes between them; that of a coarse channel does not.
"""

from __future__ import annotations

import numpy as np

from model_discrepancy.recording.spectrum import white_density

# Bins of the histogram in a standard deviation of the values, and bins of its spectrum: enough for
# steps of a thirtieth of a standard deviation.
_BINS, _SPECTRUM = 400, 1 << 15
# Steps that are looked for, in standard deviations: finer ones are next to no error, coarser ones
# are levels of the movement.
FINEST_STEP, COARSEST_STEP = 1.0 / 30.0, 0.5
# Height of the peak, 1 for values without any noise, and its ratio to what lies at lower
# frequencies. In 65 simulated recordings with fine channels and two human trials a peak is at most
# 0.41 high, or lower than what lies below; with steps of 0.7 N.m it is 0.56 to 0.91 high, and 1.4
# to 2.5 times what lies below.
LEAST_PEAK, LEAST_RATIO = 0.3, 1.15
# The peak's own first subharmonic, and its foot, do not count as what lies below.
_LOWER_FREQUENCY_RANGE = (0.35, 0.85)
# A value is on its way where those so many samples before and after it are more than a step apart:
# some milliseconds, in which a perturbation moves the torque by newton metres.
_PASSAGE = 8
# On its way a coarse channel has the same comb as everywhere (in 40 simulations with steps of 0.3
# to 1 N.m), a binary sequence with friction a tenth of it.
LEAST_PEAK_ON_THE_WAY = 0.3
# Of the channel's flat noise, in power. Where noise of half a step or more reaches a converter, the
# error that this makes is noise, too, whatever the signal (Gray & Stockham 1993, IEEE Trans. Inf.
# Theory 39, 805): a twelfth of the step's square is a quarter of it then.
LEAST_SHARE_OF_NOISE = 0.25


def coarse_step(values: np.ndarray) -> float:
    """Return the distance of the levels that a channel's values lie at; 0.0 where they lie
    anywhere, or where noise hides the levels from whatever is seen over several samples.

    Parameters
    ----------
    values
        Of one channel, shape (n,), in any unit; the step is in the same one.
    """
    deviation = float(np.std(values))
    low, high = np.percentile(values, [0.1, 99.9])
    width = deviation / _BINS
    if high - low <= 2.0 * width:
        return 0.0  # constant, but for a few values
    count, _ = np.histogram(values, np.arange(low, high, width))
    height = np.abs(np.fft.rfft(count / max(count.sum(), 1), _SPECTRUM))
    frequency = np.fft.rfftfreq(_SPECTRUM, width)
    inside = (frequency > 1.0 / (COARSEST_STEP * deviation)) & (
        frequency < 1.0 / (FINEST_STEP * deviation)
    )
    peak = int(np.argmax(np.where(inside, height, 0.0)))
    below = (frequency > _LOWER_FREQUENCY_RANGE[0] * frequency[peak]) & (
        frequency < _LOWER_FREQUENCY_RANGE[1] * frequency[peak]
    )
    if not height[peak] > max(LEAST_PEAK, LEAST_RATIO * float(height[below].max())):
        return 0.0
    step = float(1.0 / frequency[peak])
    noise = white_density(values, 1.0) / 2.0
    if step**2 / 12.0 < LEAST_SHARE_OF_NOISE * noise:
        return 0.0
    way = 2 * _PASSAGE
    passing = values[_PASSAGE:-_PASSAGE][np.abs(values[way:] - values[:-way]) > step]
    if not len(passing):
        return step
    on_the_way = abs(np.exp(2j * np.pi * passing / step).mean())
    return step if on_the_way > LEAST_PEAK_ON_THE_WAY * height[peak] else 0.0
