"""Voluntary torque as coloured noise: the whitening filters.

Model of the torque that position does not explain: white sensor noise, and under a corner frequency
f_c voluntary torque whose density falls with frequency f as (f_c / f)^2p:

    S(f) = σ² (1 + (f_c / f)^2p)

The filter that makes such noise white again, and so makes least squares the best linear unbiased
estimate (Aitken 1935), is 1 / sqrt(S): a Butterworth high-pass of order p with its corner at f_c,
applied to torque and regressors alike.

The corner is not the one under which the data are most likely. K and G are properties at the lowest
frequencies. Behind a high corner they are extrapolated from the fast part of a response by the
model's own form, and what the model leaves out (a resonance, relaxation, friction) then becomes a
stiffness or a reflex of several times the true size. So the low corner is used as long as it costs
no more than twice the standard error, three times where the model does not hold
(`noise_model_choice`).
"""

from __future__ import annotations

import numpy as np
from scipy import signal

NOISE_MODELS = ((0.3, 2), (1.1, 4), (3.3, 4))
"""Corner [Hz] and order p of each. Lower corners gain nothing: a perturbation response lasts
0.5-0.7 s. Higher ones leave too little of the reflex, which has its power below 4 Hz. Order 2 is
torque with white acceleration; order 4 a sharp end."""
LOW_CORNER, MIDDLE_CORNER = 0, 1
"""Indices of the models. Changes of the ankle are found, and the first seconds after them
estimated, under the middle corner at least: behind the low one slow voluntary torque looks like a
change, and the step of torque that a change brings with it lasts for seconds."""
SECTIONS = 2
"""Second-order sections of every filter."""


def whitening_filters(rate: float) -> np.ndarray:
    """Return the second-order sections of all filters, first impulse response sample one, shape
    (models, 2, 6).
    """
    filters = np.zeros((len(NOISE_MODELS), SECTIONS, 6))
    filters[:, :, 0] = filters[:, :, 3] = 1.0
    for model, (corner, order) in enumerate(NOISE_MODELS):
        sections = signal.butter(order, corner, "highpass", fs=rate, output="sos")
        sections[:, :3] /= sections[:, :1]
        filters[model, : len(sections)] = sections
    return filters


def needed_sections() -> np.ndarray:
    """Return how many sections each filter needs, shape (models,); the others leave a signal as it
    is.
    """
    return np.array([(order + 1) // 2 for _, order in NOISE_MODELS])


def passband_gain(sections: np.ndarray) -> float:
    """Return the gain of a high-pass at half the sampling rate."""
    return float(np.prod([(b0 - b1 + b2) / (1.0 - a1 + a2) for b0, b1, b2, _, a1, a2 in sections]))
