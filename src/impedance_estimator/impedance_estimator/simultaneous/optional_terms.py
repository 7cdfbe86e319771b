"""Three nuisance terms are taken out only as far as the memory shows that they are there.

    relaxation     k (x - x̃),   x̃ follows x with the time constant `nuisance.RELAXATION_TIME`
    bent reflex    g h(·; η) * (v₊² - m v₊),   m = Σ v₊² / Σ v₊ over the memory
    late reflex    G_l (h(·; η, D + `LATE_DELAY`) - h(·; η)) * v₊

A spindle that answers with a threshold, a power of velocity or saturation has a bent curve, and its
answers to stretches of different velocity show the bend. Stretches of one velocity do not show it.
Both reflex terms have no area over the memory. So G, the factor of h(·; η) * v₊, is the torque
impulse of the whole reflex for each radian of the stretches that were made, which is the definition
of the truth (`ankle_physics.impedance`).

The coefficient of each term has a Gaussian prior about zero. Its variance w² is the one under which
the memory is most likely, which for an estimate θ with variance s² is max(θ² - s², 0) (empirical
Bayes; Efron & Morris, J. Am. Stat. Assoc. 68 (1973) 117-130). A term that the memory does not show
has none and changes nothing. λ samples of the residual count as one observation:
`block_update.RESPONSE_SAMPLES`, or the scatter of the scores of K (of G for the reflex) where it is
larger. The estimate is then shrunk by the factor 1 - λ s² / θ², and taken for chance where θ² < λ
s². Relaxation and a late reflex have positive coefficients.
"""

from __future__ import annotations

import numpy as np

from impedance_estimator.compilation import part
from impedance_estimator.simultaneous import reflex_shapes
from impedance_estimator.simultaneous.block_update import (
    MIN_SCATTER_LENGTH,
    RESPONSE_SAMPLES,
    prior_of_unknowns,
)
from impedance_estimator.simultaneous.cholesky import solve_scaled
from impedance_estimator.simultaneous.explained_motion import TAP_WIDTH
from impedance_estimator.simultaneous.nuisance import BEND, EXTRAS, RELAXATION, TAPS
from impedance_estimator.simultaneous.regression import GAINS, INTRINSIC, PARAMETERS
from impedance_estimator.simultaneous.state import Plan, State

TERMS = 3
RELAXING, BENT, LATE_REFLEX = 0, 1, 2
"""Places of the terms."""
LATE_DELAY = 0.050
"""[s] The late response of the calf begins so long after the early one: medium- and long-latency
responses begin at 70 to 100 ms where the first begins at 40 ms (Petersen et al., J. Physiol. 509
(1998); Grey et al., J. Physiol. 534 (2001))."""
LEAST_SPREAD = 0.02
"""A bend needs stretches whose velocities vary by at least this share of their mean square: 14 %.
Pulses and steps of one size have up to 0.013 on the independent rig, random ones 0.06 to 0.28."""
RIDGE = 1e-9
"""This share of a term's own sum of squares is added to it, so that one that others imitate is no
error."""


@part
def optional_terms(p: Plan, s: State, explained_sums: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the terms that the memory shows.

    Parameters
    ----------
    p, s
        Plan and state of the estimator; the state's mean velocity of stretches is renewed.
    explained_sums
        X̂'[X̂, τ] of the memory, shape (n, n + 1).

    Returns
    -------
    tuple
        Each term as a combination of the recorded signals, shape (n, k), and the standard
        deviations of the priors of their coefficients, shape (k,); k from 0 to 3.
    """
    size = explained_sums.shape[0]
    c = s.counters[0]
    terms = np.zeros((size, TERMS))
    widths = np.zeros(TERMS)
    enough = c.length >= MIN_SCATTER_LENGTH * p.second and np.isfinite(c.variance)
    if enough and not p.modelled_reflex:
        allowed = _describe(p, s, explained_sums, terms)
        _find_widths(s, explained_sums, terms, allowed, widths)
    shown = np.flatnonzero(widths > 0.0)
    return np.ascontiguousarray(terms[:, shown]), widths[shown]


@part
def mean_response(s: State, function: int) -> float:
    """Return the coefficient of one function of the basis in the mean reflex response
    [N.m.s/rad]: the muscle's, the late reflex', and that of a bent reflex to stretches of the mean
    velocity.

    Parameters
    ----------
    s
        State of the estimator.
    function
        Number of the function.
    """
    added = s.nuisance.coefficients
    bend = added[added.shape[0] - EXTRAS + BEND]
    early = s.response[function] + added[INTRINSIC + function]
    return early + bend * s.counters[0].mean_stretch * s.tangent[function, 0]


@part
def _describe(p: Plan, s: State, sums: np.ndarray, terms: np.ndarray) -> np.ndarray:
    """Set the terms, shape (n, 3), and return which of them the movements can show."""
    c = s.counters[0]
    size, functions = sums.shape[0], p.area.shape[0]
    extras = size - EXTRAS
    allowed = np.ones(TERMS, dtype=np.bool_)
    terms[extras + RELAXATION, RELAXING] = 1.0
    total = square = 0.0
    for back in range(c.length):
        block = s.stretches[(c.newest - back) % s.stretches.shape[0]]
        total += block[0]
        square += block[1]
    c.mean_stretch = square / total if total > 0.0 else 0.0
    muscle = np.zeros(size)
    for j in range(functions):
        muscle[INTRINSIC + j] = c.mean_stretch * s.tangent[j, 0]
    terms[extras + BEND, BENT] = 1.0
    terms[:, BENT] -= muscle
    allowed[BENT] = _spread(sums, terms[:, BENT].copy(), muscle) >= LEAST_SPREAD
    late = np.empty(functions)
    eta = s.eta[0].copy()
    eta[2] += LATE_DELAY
    reflex_shapes.coordinates(eta, p.basis, p.lags, s.shape_work[0], late)
    early_area = late_area = 0.0
    for j in range(functions):
        early_area += p.area[j] * s.tangent[j, 0]
        late_area += p.area[j] * late[j]
    for j in range(functions):
        terms[INTRINSIC + j, LATE_REFLEX] = late[j] * early_area / late_area - s.tangent[j, 0]
    return allowed


@part
def _spread(sums: np.ndarray, bend: np.ndarray, muscle: np.ndarray) -> float:
    """Return the power of the part of a signal that another one does not explain, over the power
    of that one [1].
    """
    size = sums.shape[0]
    squares = np.ascontiguousarray(sums[:, :size])
    along = np.dot(squares, muscle)
    power = np.dot(muscle, along)
    if not power > 0.0:
        return 0.0
    return (np.dot(bend, np.dot(squares, bend)) - np.dot(bend, along) ** 2 / power) / power


@part
def _find_widths(
    s: State,
    sums: np.ndarray,
    terms: np.ndarray,
    allowed: np.ndarray,
    widths: np.ndarray,
) -> None:
    """Set the prior's standard deviation of each term: zero where the memory does not show it."""
    size = sums.shape[0]
    extras = size - EXTRAS
    variance = s.counters[0].variance
    fixed = PARAMETERS + TAPS
    signals = np.zeros((size, fixed + TERMS))
    for i in range(INTRINSIC):
        signals[i, i] = 1.0
    signals[INTRINSIC:extras, INTRINSIC:PARAMETERS] = s.tangent
    for tap in range(TAPS):
        signals[extras + tap, PARAMETERS + tap] = 1.0
    signals[:, fixed:] = terms
    along = np.dot(signals.T, sums)
    normal = np.dot(along[:, :size].copy(), signals)
    precision, mean = np.zeros(PARAMETERS), np.zeros(PARAMETERS)
    prior_of_unknowns(s, precision, mean)
    for i in range(PARAMETERS):
        normal[i, i] += variance * precision[i]
        along[i, size] += variance * precision[i] * mean[i]
    for tap in range(TAPS):
        normal[PARAMETERS + tap, PARAMETERS + tap] += variance / TAP_WIDTH**2
    while True:
        used = np.flatnonzero(allowed)
        count = fixed + used.shape[0]
        places = np.arange(count)
        places[fixed:] = fixed + used
        matrix, right = np.empty((count, count)), np.zeros((count, 1 + used.shape[0]))
        for i in range(count):
            for j in range(count):
                matrix[i, j] = normal[places[i], places[j]]
            right[i, 0] = along[places[i], size]
        for k in range(used.shape[0]):
            matrix[fixed + k, fixed + k] *= 1.0 + RIDGE
            right[fixed + k, 1 + k] = 1.0
        known, _ = solve_scaled(matrix, 0.0, right)
        if not known:
            return
        negative = False
        for k in range(used.shape[0]):
            if used[k] != BENT and right[fixed + k, 0] <= 0.0:
                allowed[used[k]] = False
                negative = True
        if not negative:
            break
    for k in range(used.shape[0]):
        estimate, spread = right[fixed + k, 0], variance * right[fixed + k, 1 + k]
        scatter = s.scatter[s.counters[0].model, 0 if used[k] == RELAXING else GAINS - 1]
        samples = max(scatter, RESPONSE_SAMPLES)
        widths[used[k]] = np.sqrt(max(estimate**2 / samples - spread, 0.0))
