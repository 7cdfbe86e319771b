"""Voluntary torque as coloured noise: whitening filters, and which of them fits.

Model of the torque that position does not explain: white sensor noise, and under a corner frequency
f_c voluntary torque whose density falls with frequency f as (f_c / f)^2p:

    S(f) = σ² (1 + (f_c / f)^2p)

The filter that makes such noise white again, and so makes least squares the best linear unbiased
estimate (Aitken 1935), is 1 / sqrt(S): a Butterworth high-pass of order p with its corner at f_c,
applied to torque and regressors alike. Which corner and order: the ones under which the data are
most likely. For a causal, minimum-phase filter whose first impulse response sample is one, the
filtered residual e is the one-step prediction error, and (Box & Jenkins 1970, chapter 7)

    ln L = -n/2 ln( Σ e² / n ) + const

The corner is where voluntary torque sinks into sensor noise, not where it ends: 1 N.m rms below 1
Hz reaches the noise of the paper's torque signal near 4 Hz, 0.5 N.m rms below 0.3 Hz near 1.2 Hz.
"""

from __future__ import annotations

import numpy as np
from scipy import signal

from impedance_estimator.compilation import part

NOISE_MODELS = ((0.3, 2), (1.0, 2), (3.0, 2), (1.1, 4), (3.3, 4))
"""Corner [Hz] and order p of each. Lower corners gain nothing: a perturbation response lasts
0.5-0.7 s. Higher ones leave too little of the reflex, which has its power below 4 Hz. Order 2 is
torque with white acceleration; order 4 a sharp end."""
FIRST_MODEL = 4
"""This model is used until data have chosen: too high a corner costs precision, too low a one takes
voluntary torque for changes of the ankle.
"""
SECTIONS = 2
"""Second-order sections of every filter."""


def whitening_filters(rate: float) -> np.ndarray:
    """Second-order sections of all filters, first impulse response sample one, shape (models, 2,
    6).
    """
    filters = np.zeros((len(NOISE_MODELS), SECTIONS, 6))
    filters[:, :, 0] = filters[:, :, 3] = 1.0
    for model, (corner, order) in enumerate(NOISE_MODELS):
        sections = signal.butter(order, corner, "highpass", fs=rate, output="sos")
        sections[:, :3] /= sections[:, :1]
        filters[model, : len(sections)] = sections
    return filters


def passband_gain(sections: np.ndarray) -> float:
    """Gain of a high-pass at half the sampling rate."""
    return float(np.prod([(b0 - b1 + b2) / (1.0 - a1 + a2) for b0, b1, b2, _, a1, a2 in sections]))


@part
def most_likely(likelihood: np.ndarray, present: int, margin: float) -> int:
    """The noise model with the largest ln L; the present one unless another is better by more than
    `margin`.
    """
    best = int(np.argmax(likelihood))
    return best if likelihood[best] > likelihood[present] + margin else present
