"""The regression uses the motion that the reference explains, without nuisance terms.

Two things spoil a regression of torque on measured motion.

**The closed loop.** A servo gives way, so torque that no movement causes (voluntary torque, tremor,
the reflex' variation) moves the plate and stands in the measured motion. The commanded reference
carries none of it. With instruments Z (the reference passed through a nominal actuator, and the
same features of it as of the measured motion X), every regressor is replaced by the part of it
that the instruments explain (two-stage least squares; Söderström & Stoica, System Identification,
1989, chapter 8):

    X̂ = Z Π,   Π = (Z'Z)⁻¹ Z'X

Without a reference the instruments are the measured motion itself, and Π is the identity.

**What is beyond I, B and K.** Nuisance terms take up a skew between torque and motion, a lag or a
mode of the torque sensor. Their coefficients have Gaussian priors, and they are
eliminated (Frisch & Waugh, Econometrica 1 (1933)): with A = Q̂'Q̂ + prior and Γ = A⁻¹ Q̂'[X̂, τ],

    r̃ = r̂ - Q̂ Γ        for each regressor and for the torque

So the sums over any stretch of data that the rest of the estimator needs are those of fixed linear
combinations T of the recorded signals, found twice a second from the whole memory.

Relaxation, a bent and a late reflex are taken out as far as the memory shows them
(`optional_terms`). Yielding (Dahl 1968) and stiffness that depends on position are not: a
perturbation of small steps does not tell them from stiffness well enough, and K then is off by
several times its value. How much more likely they make the memory is a sign of doubt (`doubt`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from impedance_estimator.compilation import part
from impedance_estimator.simultaneous.cholesky import solve_scaled
from impedance_estimator.simultaneous.nuisance import BEND, EXTRAS, TAPS, reducible_size
from impedance_estimator.simultaneous.state import Plan, State


def chosen_terms(*terms: int) -> np.ndarray:
    """Return which nuisance terms of `WIDTHS` are among some, shape (BEND,)."""
    return np.isin(np.arange(BEND), terms)


ALL_TAPS, NO_TERM = chosen_terms(*range(TAPS)), chosen_terms()
TAP_WIDTH = 0.01
"""[kg.m²] Prior standard deviation of a shifted acceleration's coefficient: as much as the inertia
itself, which a skew of several milliseconds needs."""
WIDTHS = np.array([*np.full(TAPS, TAP_WIDTH), 60.0, 2.0, 2000.0, 1e5])
"""Prior standard deviations of the nuisance terms before `nuisance.BEND`; behind the shifted
accelerations [N.m/rad, N.m, N.m/rad², N.m/rad³] of the size of the elastic torque within a
perturbation of 30 mrad."""
INSTRUMENT_RIDGE = 1e-9
"""This share of the scaled instruments' own sums is added to them, so that a signal that never
moves is no error.
"""


class Memory(NamedTuple):
    """Holds the sums of a stretch of data: Z'Z, Z'[X, τ], τ'τ, and the number of samples."""

    instruments: np.ndarray
    cross: np.ndarray
    square: float
    samples: float


@part
def memory_of(p: Plan, s: State, sums: np.ndarray, blocks: int) -> Memory:
    """Return matrices from what `nuisance.accumulate` added up over so many blocks."""
    size = s.nuisance.combine.shape[1]
    instruments, cross = np.empty((size, size)), np.empty((size, size + 1))
    k = 0
    for i in range(size):
        for j in range(i, size):
            instruments[i, j] = instruments[j, i] = sums[k]
            k += 1
    short = reducible_size(size)
    referenced = s.counters[0].referenced
    for i in range(size):
        for j in range(size):
            cross[i, j] = sums[short + i * size + j] if referenced else instruments[i, j]
        cross[i, size] = sums[k + i]
    return Memory(instruments, cross, sums[short - 1], float(blocks * p.block_samples))


@part
def explained(memory: Memory, referenced: bool) -> tuple[bool, np.ndarray, np.ndarray]:
    """Return whether the instruments tell anything, Π, shape (n, n), and the sums X̂'[X̂, τ] of the
    explained motion, shape (n, n + 1).
    """
    size = memory.instruments.shape[0]
    if not referenced:
        return True, np.eye(size), memory.cross
    projection = memory.cross[:, :size].copy()
    known, _ = solve_scaled(memory.instruments, INSTRUMENT_RIDGE, projection)
    along = np.empty((size, size + 1))
    along[:, :size] = np.dot(memory.instruments, projection)
    along[:, size] = memory.cross[:, size]
    return known, projection, np.dot(projection.T, along)


@part
def signals_of(chosen: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the chosen nuisance terms as combinations of the recorded signals, shape (n, k), and
    the standard deviations of their priors, shape (k,).
    """
    picked = np.flatnonzero(chosen)
    terms = np.zeros((size, picked.shape[0]))
    for k in range(picked.shape[0]):
        terms[size - EXTRAS + picked[k], k] = 1.0
    return terms, WIDTHS[picked]


@part
def eliminated(
    explained_sums: np.ndarray, terms: np.ndarray, widths: np.ndarray, variance: float
) -> tuple[bool, np.ndarray]:
    """Return whether the sums tell some nuisance terms, and Γ per recorded signal.

    Parameters
    ----------
    explained_sums
        X̂'[X̂, τ], shape (n, n + 1).
    terms
        Each term as a combination of the recorded signals, shape (n, k).
    widths
        Standard deviations of the priors of their coefficients, shape (k,).
    variance
        Of the noise [N²m²].

    Returns
    -------
    tuple
        Whether they are determined, and Γ, shape (n, n - EXTRAS + 1): what of each recorded signal
        is taken off each regressor and, last, the torque.
    """
    size = explained_sums.shape[0]
    base = size - EXTRAS
    count = terms.shape[1]
    if count == 0:
        return True, np.zeros((size, base + 1))
    along = np.dot(terms.T, explained_sums)
    normal = np.dot(along[:, :size].copy(), terms)
    right = np.empty((count, base + 1))
    for i in range(count):
        normal[i, i] += variance / widths[i] ** 2
        right[i, :base] = along[i, :base]
        right[i, base] = along[i, size]
    known, _ = solve_scaled(normal, 0.0, right)
    return known, np.dot(terms, right)


@part
def combination(projection: np.ndarray, gamma: np.ndarray) -> np.ndarray:
    """Return T, shape (m + 4, n); the last row is what is subtracted from the torque."""
    size = projection.shape[0]
    base = gamma.shape[1] - 1
    taken = np.dot(projection, gamma)
    combine = np.empty((base + 1, size))
    for i in range(base):
        for k in range(size):
            combine[i, k] = projection[k, i] - taken[k, i]
    combine[base] = taken[:, base]
    return combine


@part
def reduced_sums(memory: Memory, combine: np.ndarray) -> np.ndarray:
    """Return sums of products of position, velocity, acceleration, the m signals of the reflex
    basis and, last, the torque; shape (m + 4, m + 4).
    """
    size = combine.shape[1]
    base = combine.shape[0] - 1
    left = np.dot(combine, memory.instruments)
    reduced = np.dot(left, combine.T)
    square = memory.square + reduced[base, base]
    for k in range(size):
        square -= 2.0 * combine[base, k] * memory.cross[k, size]
    for i in range(base):
        value = -reduced[i, base]
        for k in range(size):
            value += combine[i, k] * memory.cross[k, size]
        reduced[i, base] = reduced[base, i] = value
    reduced[base, base] = square
    return reduced
