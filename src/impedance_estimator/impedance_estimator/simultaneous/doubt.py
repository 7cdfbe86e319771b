"""An estimate is doubted where signs show that its model does not hold.

Each sign is a number; at its limit it makes a doubt of one half, at one and a half times the limit
full doubt. The limits were set on the independent rig (MuJoCo): without a mismatch 5 % of the
estimates may be doubted; nothing of this project's own simulation is in them.
"""

from __future__ import annotations

import numpy as np
from numba.extending import register_jitable

from impedance_estimator.compilation import part
from impedance_estimator.simultaneous.regression import GAINS
from impedance_estimator.simultaneous.state import State

SIGNS = ("breadth", "disagreement", "structure", "imprecision", "negativity")

LIMITS = np.array([15.0, 4.0, 1.0, 1.0, 4.0])
"""Each of `SIGNS` has a limit: ln L by which a wider intrinsic response than that of inertia,
viscosity and stiffness behind a delay makes the memory more likely (without a mismatch up to 12);
difference of K or G between both halves of the memory over its standard error [1]; ln L that
relaxation, yielding or powers of position gain, over `STRUCTURE_GAINS`; relative standard error of
K or G over `LARGEST_ERRORS`; by how many standard errors K or I is negative.
"""
STRUCTURE_GAINS = np.array([110.0, 80.0, 75.0])
"""ln L that relaxation, yielding, and powers of position must gain. Without a mismatch the
independent rig gave up to 95, 70 and 71 in 95 of 96 recordings, and once powers of position 122."""
LARGEST_ERRORS = (0.14, 0.12)
"""Relative standard errors of K and G from which an estimate is doubted. Without a mismatch the
independent rig gave up to 9 and 7 %; a reflex with a threshold or one that saturates scatters more
from stretch to stretch than one that is proportional to velocity."""
DOUBT_THRESHOLD = 0.5
"""From this doubt on, a sign at its limit, an estimate is called doubtful."""
MODEL_ERROR = np.array([0.02, 0.03, 0.02, 0.025])
"""K, B, I and G have this relative error beyond the scatter within a recording: a joint is never
exactly the model. The size is what was left on the independent rig in recordings that are not
doubted; in those without a mismatch K has half of it."""
DOUBTED_ERROR = np.array([0.3, 0.3, 0.1, 0.2])
"""At full doubt the relative error beyond the scatter is this much larger: the root mean square
error of doubted recordings of the independent rig, but for a few that are off by their own size."""

_SENTENCES = (
    "the intrinsic response is not that of inertia, viscosity and stiffness (straps? friction?)",
    "both halves of the memory disagree about K or G",
    "tissue relaxes, yields or hardens, or the reflex is not proportional to velocity",
    "the standard error of K is over 14 % or that of G over 12 %",
    "K or I is negative (is the sign of torque or position right?)",
)
_STIFFNESS, _INERTIA = 0, 2


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


def imprecision(stiffness: float, gain: float) -> float:
    """Return the larger one of the relative standard errors of K and G [1] over `LARGEST_ERRORS`
    [1].
    """
    return max(stiffness / LARGEST_ERRORS[0], gain / LARGEST_ERRORS[1])


def imprecision_doubt(stiffness: float, gain: float) -> float:
    """Return the doubt, 0 to 1, that relative standard errors of K and G [1] make."""
    return _doubt(imprecision(stiffness, gain))


@register_jitable
def _doubt(size: float) -> float:
    """Return the doubt that a sign makes, of its size over its limit [1]."""
    return min(max(size - 0.5, 0.0), 1.0)


@part
def structural_doubt(s: State) -> float:
    """Return the doubt, 0 to 1, that signs of another structure than the model's make: breadth and
    structure. Imprecision and disagreement may come of voluntary torque.
    """
    return _doubt(max(s.signs[0] / LIMITS[0], s.signs[2] / LIMITS[2]))


@part
def judge(s: State) -> None:
    """Set the doubt, 0 to 1, after all signs of the state are read, and the model's share of the
    standard errors; the largest sign counts.
    """
    c = s.counters[0]
    s.signs[3:] = 0.0
    for k, output in enumerate((0, GAINS - 1)):
        scatter = max(s.scatter[c.model, output], 1.0)
        error = np.sqrt(c.variance * scatter * s.output[1, output])
        relative = error / max(abs(s.output[0, output]), 1e-6)
        s.signs[3] = max(s.signs[3], relative / LARGEST_ERRORS[k])
    for output in (_STIFFNESS, _INERTIA):
        scatter = max(s.scatter[c.model, output], 1.0)
        error = np.sqrt(c.variance * scatter * s.output[1, output])
        s.signs[4] = max(s.signs[4], -s.output[0, output] / max(error, 1e-12))
    c.doubt = _doubt(np.max(s.signs / LIMITS))
    s.model_error[:] = MODEL_ERROR + DOUBTED_ERROR * c.doubt
