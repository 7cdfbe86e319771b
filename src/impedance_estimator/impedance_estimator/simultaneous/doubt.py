"""An estimate is doubted where signs show that its model does not hold.

Each sign is a number; at its limit it makes a doubt of one half, at one and a half times its limit
full doubt. The limits were set on the independent rig (MuJoCo) without a mismatch, where 5 % of the
estimates may be doubted; nothing of this project's own simulation is in them.
"""

from __future__ import annotations

import numpy as np

from impedance_estimator.simultaneous.state import State

SIGNS = ("misfit", "ringing", "disagreement", "structure", "imprecision")

LIMITS = np.array([0.075, 0.30, 4.0, 0.5, 0.25])
"""Each of `SIGNS` has a limit: relative difference between the intrinsic response and that of
inertia, viscosity and stiffness behind a delay [1]; most negative autocorrelation of the residual
between 8 and 31 ms [1]; difference of K or G between both halves of the memory over its standard
error [1]; whether relaxation, yielding or a stiffness that depends on position was found [1];
standard error of K or G over its value [1].
"""

_SENTENCES = (
    "the intrinsic response is not that of inertia, viscosity and stiffness (straps? shaft?)",
    "the residual rings (a resonance between 16 and 64 Hz)",
    "both halves of the memory disagree about K or G",
    "tissue relaxes, yields or hardens",
    "the standard error of K or G is over a quarter of its value",
)


def reasons(signs: np.ndarray) -> str:
    """Return the signs at or beyond their limits, in words; empty where there is none.

    Parameters
    ----------
    signs
        Shape (5,), in the order of `SIGNS`.
    """
    return "; ".join(
        sentence
        for sentence, sign, limit in zip(_SENTENCES, signs, LIMITS, strict=True)
        if sign >= limit
    )


def doubt_of(s: State) -> float:
    """Return the doubt, 0 to 1, after all signs of the state are read; the largest of them
    counts.
    """
    c = s.counters[0]
    if s.autocovariance[0] > 0.0:
        s.signs[1] = max(-float(np.min(s.autocovariance[2:] / s.autocovariance[0])), 0.0)
    s.signs[3] = float(c["structure"] > 0)
    error = np.sqrt(c["variance"] * np.maximum(s.scatter, 1.0) * s.output[1])
    relative = error / np.maximum(np.abs(s.output[0]), 1e-6)
    s.signs[4] = max(relative[0], relative[3])
    return float(np.clip(np.max(s.signs / LIMITS) - 0.5, 0.0, 1.0))
