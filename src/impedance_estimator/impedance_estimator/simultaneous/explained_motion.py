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

Relaxation, yielding (Dahl 1968) and stiffness that depends on position are not taken out: a
perturbation of small steps does not tell them from stiffness well enough, and K then is off by
several times its value. How much more likely they make the memory is a sign of doubt (`doubt`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import linalg

from impedance_estimator.simultaneous.block_update import MIN_SCATTER_LENGTH, RESPONSE_SAMPLES
from impedance_estimator.simultaneous.doubt import STRUCTURE_GAINS, judge
from impedance_estimator.simultaneous.nuisance import (
    CUBE,
    EXTRAS,
    RELAXATION,
    SQUARE,
    TAPS,
    YIELDING,
    reducible_size,
)
from impedance_estimator.simultaneous.regression import GAINS, INTRINSIC, PARAMETERS
from impedance_estimator.simultaneous.state import Plan, State

ALL_TAPS = tuple(range(TAPS))
SKEW = (0, 1)
"""The accelerations one decimated sample later and earlier take up a delay; what the others explain
beside them is another response than that of inertia, viscosity and stiffness."""
STRUCTURES: tuple[tuple[int, ...], ...] = ((RELAXATION,), (YIELDING,), (SQUARE, CUBE))
"""Nuisance signals that would be relaxation, yielding, or powers of position."""
TAP_SHIFTS = np.repeat(np.arange(1.0, TAPS // 2 + 1.0), 2) * np.tile([1.0, -1.0], TAPS // 2)
"""Decimated samples by which each shifted acceleration is late, as `nuisance.tap_shift`."""
TAP_WIDTH = 0.01
"""[kg.m²] Prior standard deviation of a shifted acceleration's coefficient: as much as the inertia
itself, which a skew of several milliseconds needs."""
EXTRA_WIDTHS = {RELAXATION: 60.0, YIELDING: 2.0, SQUARE: 2000.0, CUBE: 1e5}
"""[N.m/rad, N.m, N.m/rad², N.m/rad³] Prior standard deviations: of the size of the elastic torque
within a perturbation of 30 mrad."""
REVIEW_PERIOD = 2
"""[s] Signs of doubt are read so often: they change with the memory, which lasts 10 s."""
IMMATERIAL_SHARE = 1e-3
"""What explains less of the torque's power than this is no sign of doubt: a recording with next to
no noise would make any difference of two computations likely. The diagnosis has the same share."""
UNREFERENCED_SHARE = 2e-3
"""Without a reference a wider response is a sign from this share of the torque's power on. Noise of
the measured motion gave up to 0.0007 on the independent rig without a mismatch, straps, a soft
shaft, backlash and yielding 0.005 to 0.02."""
UNREFERENCED_CHANGES = np.array([0.03, 0.05])
"""Or where it changes K or G by this share. Without a mismatch it changed them by up to 1 and 3 %
where it was likely."""
UNREFERENCED_FACTORS = np.array([1.0, 10.0, 10.0])
"""Without a reference the limits of relaxation, yielding and powers of position are higher by these
factors: a servo that gives way lets torque into the measured motion, whose yielding and powers then
gained up to 180 and 340 without a mismatch; relaxation gained up to 40, as with a reference."""
INSTRUMENT_RIDGE = 1e-9
"""This share of the scaled instruments' own sums is added to them, so that a signal that never
moves is no error.
"""
LARGEST_DELAY = 0.012
"""A delay [s] of at most this lies within the reach of the shifted accelerations."""
DELAY_STEP = 0.00025
"""The delay is searched in steps of this size [s]; a parabola through the best three follows."""
FREQUENCIES = np.arange(3.0, 25.0, 3.0)
"""At these frequencies [Hz] the perturbation has its power, and inertia, viscosity and stiffness
theirs."""
SHORTEST_HALF_MEMORY = 5.0
"""A half of the memory must be this long [s] to disagree with the other: a dozen perturbations."""


class Memory(NamedTuple):
    """Holds the sums of a stretch of data: Z'Z, Z'[X, τ], τ'τ, and the number of samples."""

    instruments: np.ndarray
    cross: np.ndarray
    square: float
    samples: float


class Solution(NamedTuple):
    """Holds a regression: unknowns, their covariance, the evidence ln L for its model, and the sum
    of squares that it leaves.
    """

    unknowns: np.ndarray
    covariance: np.ndarray
    evidence: float
    left: float

    @property
    def gains(self) -> np.ndarray:
        """Return K and G."""
        return self.unknowns[[0, INTRINSIC]]


def memory_of(p: Plan, s: State, sums: np.ndarray, blocks: int) -> Memory:
    """Return matrices from what `nuisance.accumulate` added up over so many blocks."""
    size = s.nuisance.combine.shape[1]
    instruments = np.zeros((size, size))
    upper = np.triu_indices(size)
    instruments[upper] = sums[: len(upper[0])]
    instruments += np.triu(instruments, 1).T
    short = reducible_size(size)
    torque = sums[len(upper[0]) : short - 1]
    motion = sums[short:].reshape(size, size) if s.counters[0]["referenced"] else instruments
    return Memory(
        instruments,
        np.column_stack([motion, torque]),
        float(sums[short - 1]),
        float(blocks * p.block_samples),
    )


def explained(memory: Memory, referenced: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return Π, shape (n, n), and the sums X̂'[X̂, τ] of the explained motion, shape (n, n + 1)."""
    size = len(memory.instruments)
    if not referenced:
        return np.eye(size), memory.cross
    scale = 1.0 / np.sqrt(np.maximum(np.diag(memory.instruments), 1e-300))
    scaled = memory.instruments * scale[:, None] * scale
    factor = linalg.cho_factor(scaled + INSTRUMENT_RIDGE * np.eye(size), check_finite=False)
    motion = memory.cross[:, :size]
    projection = scale[:, None] * linalg.cho_solve(factor, scale[:, None] * motion)
    return projection, projection.T @ np.column_stack(
        [memory.instruments @ projection, memory.cross[:, size]]
    )


def eliminated(explained_sums: np.ndarray, terms: tuple[int, ...], variance: float) -> np.ndarray:
    """Return Γ, shape (EXTRAS, n - EXTRAS + 1); rows of terms that are left out are zero."""
    base = len(explained_sums) - EXTRAS
    chosen = list(terms)
    gamma = np.zeros((EXTRAS, base + 1))
    if not chosen:
        return gamma
    rows = [base + extra for extra in chosen]
    prior = variance / np.array([EXTRA_WIDTHS.get(extra, TAP_WIDTH) for extra in chosen]) ** 2
    normal = explained_sums[np.ix_(rows, rows)] + np.diag(prior)
    scale = 1.0 / np.sqrt(np.diag(normal))
    factor = linalg.cho_factor(normal * scale[:, None] * scale, check_finite=False)
    right = explained_sums[np.ix_(rows, [*range(base), -1])]
    gamma[chosen] = scale[:, None] * linalg.cho_solve(factor, scale[:, None] * right)
    return gamma


def combination(projection: np.ndarray, gamma: np.ndarray) -> np.ndarray:
    """Return T, shape (m + 4, n); the last row is what is subtracted from the torque."""
    base = len(projection) - EXTRAS
    combine = np.zeros((base + 1, len(projection)))
    combine[:base] = projection[:, :base].T
    combine[:base] -= (projection[:, base:] @ gamma[:, :base]).T
    combine[base] = projection[:, base:] @ gamma[:, base]
    return combine


def reduced_sums(memory: Memory, combine: np.ndarray) -> np.ndarray:
    """Return sums of products of position, velocity, acceleration, the m signals of the reflex
    basis and, last, the torque; shape (m + 4, m + 4).
    """
    base = len(combine) - 1
    signals, taken = combine[:base], combine[base]
    left = signals @ memory.instruments
    reduced = np.empty((base + 1, base + 1))
    reduced[:base, :base] = left @ signals.T
    reduced[:base, base] = reduced[base, :base] = signals @ memory.cross[:, -1] - left @ taken
    reduced[base, base] = (
        memory.square - 2.0 * taken @ memory.cross[:, -1] + taken @ memory.instruments @ taken
    )
    return reduced


def normal_equations(s: State, memory: Memory, combine: np.ndarray) -> np.ndarray:
    """Return sums of products of the unknowns' signals and, last, the torque; shape (8, 8)."""
    base = len(combine) - 1
    unknowns = np.zeros((base + 1, PARAMETERS + 1))
    unknowns[:INTRINSIC, :INTRINSIC] = np.eye(INTRINSIC)
    unknowns[INTRINSIC:base, INTRINSIC:PARAMETERS] = s.tangent
    unknowns[base, -1] = 1.0
    return unknowns.T @ reduced_sums(memory, combine) @ unknowns


def prior_of(s: State, variance: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the precision, in units of the noise variance, and the mean of all unknowns."""
    shape = RESPONSE_SAMPLES / s.eta[2] ** 2
    precision = variance * np.concatenate([1.0 / s.prior[1] ** 2, shape])
    return precision, np.concatenate([s.prior[0], s.eta[1] - s.eta[0]])


def solve(
    s: State, normal: np.ndarray, count: float, variance: float, immaterial: float = 0.0
) -> Solution:
    """Return the regression over a stretch, and ln p(data | prior) up to a constant, with the
    noise at its most likely size, and a sum of squares that is `immaterial` beside it.
    """
    precision, mean = prior_of(s, variance)
    matrix = normal[:-1, :-1] + np.diag(precision)
    scale = 1.0 / np.sqrt(np.diag(matrix))
    factor = linalg.cho_factor(matrix * scale[:, None] * scale, check_finite=False)
    inverse = scale[:, None] * linalg.cho_solve(factor, np.diag(scale))
    unknowns = inverse @ (normal[:-1, -1] + precision * mean)
    rest = normal[-1, -1] + unknowns @ (normal[:-1, :-1] @ unknowns - 2.0 * normal[:-1, -1])
    total = max(rest, 1e-300) + np.sum(precision * (unknowns - mean) ** 2)
    determinant = 2.0 * np.sum(np.log(np.diag(factor[0]) / scale)) - np.sum(np.log(precision))
    noise = total + immaterial
    evidence = -0.5 * (count * np.log(noise / count) + determinant)
    return Solution(unknowns, inverse, float(evidence), float(rest))


def clean_motion(p: Plan, s: State) -> None:
    """Find anew what of the motion the reference explains, and take the nuisance terms out.

    Called twice a second, before a block is added to the memory; every `REVIEW_PERIOD` the signs
    of doubt are read.
    """
    c = s.counters[0]
    if c["length"] < 1:
        return
    memory = memory_of(p, s, s.totals[c["model"]], c["length"])
    known = bool(np.isfinite(c["variance"]))
    variance = float(c["variance"]) if known else memory.square / memory.samples
    if not variance > 0.0:
        return
    try:
        projection, sums = explained(memory, bool(c["referenced"]))
        review = (
            known
            and c["length"] >= MIN_SCATTER_LENGTH * p.second
            and c["blocks"] % (REVIEW_PERIOD * p.second) == 0
        )
        # What lies between joint and sensors is undone where a calibration tells it.
        gamma = eliminated(sums, () if p.modelled_reflex else ALL_TAPS, variance)
        if review:
            s.signs[0], s.signs[2] = _unmodelled(
                s, memory, projection, sums, () if p.modelled_reflex else SKEW
            )
    except linalg.LinAlgError:
        # Too few data: what was found before stays in use.
        return
    s.nuisance.gamma[:] = gamma
    s.nuisance.combine[:] = combination(projection, gamma)
    if known and not p.modelled_reflex:
        _state_delay(p, s)
    if review:
        s.signs[1] = _halves_apart(p, s)
        judge(s)


def _unmodelled(
    s: State, memory: Memory, projection: np.ndarray, sums: np.ndarray, usual: tuple[int, ...]
) -> tuple[float, float]:
    """Return how much more likely (ln L) the memory is with a wider intrinsic response than that of
    I, B, K and the usual nuisance terms; and with the best of `STRUCTURES`, over its limit.
    """
    variance = float(s.counters[0]["variance"])
    immaterial = IMMATERIAL_SHARE * memory.square

    def solution(terms: tuple[int, ...]) -> Solution:
        combine = combination(projection, eliminated(sums, terms, variance))
        normal = normal_equations(s, memory, combine)
        return solve(s, normal, memory.samples, variance, immaterial)

    plain, wider = solution(usual), solution(ALL_TAPS)
    breadth = wider.evidence - plain.evidence
    limits = STRUCTURE_GAINS
    if not s.counters[0]["referenced"]:
        limits = limits * UNREFERENCED_FACTORS
        if not _matters(plain, wider, memory.square):
            breadth = 0.0
    gains = [solution(usual + structure).evidence - plain.evidence for structure in STRUCTURES]
    return breadth, float(np.max(np.array(gains) / limits))


def _matters(plain: Solution, wider: Solution, square: float) -> bool:
    """Say whether a wider intrinsic response explains enough of the torque, or changes K or G
    enough, to be more than noise of the measured motion.

    Several shifted accelerations in place of one average that noise away, which makes them as
    likely as a joint that is wider does.
    """
    moved = np.abs(wider.gains - plain.gains) / np.maximum(np.abs(plain.gains), 1e-6)
    explained_share = (plain.left - wider.left) / square
    return bool(explained_share > UNREFERENCED_SHARE or np.any(moved > UNREFERENCED_CHANGES))


def intrinsic_response(p: Plan, s: State) -> np.ndarray:
    """Return the torque per position of the intrinsic pathway at `FREQUENCIES`, shape (k,)."""
    omega = 2.0 * np.pi * FREQUENCIES
    stiffness, damping, inertia = s.solution[:INTRINSIC]
    response = stiffness + 1j * omega * damping - omega**2 * inertia
    for tap in range(TAPS):
        turn = omega * TAP_SHIFTS[tap] * p.decimation / p.rate
        response -= omega**2 * s.nuisance.coefficients[tap] * (np.exp(-1j * turn) - 1.0)
    return response


def behind_delay(
    response: np.ndarray, stiffness: float, delays: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return B, I, and the relative misfit of joints with a stiffness and a late torque, for each
    delay.

    Parameters
    ----------
    response
        Of the intrinsic pathway at `FREQUENCIES`, shape (k,).
    stiffness
        Stiffness K of the joint [N.m/rad].
    delays
        By which the torque is late [s], shape (d,).
    """
    omega = 2.0 * np.pi * FREQUENCIES
    aligned = response * np.exp(1j * omega * delays[:, None])
    weight = 1.0 / (np.abs(response) ** 2 + 1.0)
    damping = (aligned.imag * omega) @ weight / np.sum(weight * omega**2)
    inertia = ((stiffness - aligned.real) * omega**2) @ weight / np.sum(weight * omega**4)
    fitted = stiffness + 1j * omega * damping[:, None] - omega**2 * inertia[:, None]
    return damping, inertia, np.sqrt(np.abs(aligned - fitted) ** 2 @ weight / len(omega))


def _state_delay(p: Plan, s: State) -> None:
    """Return the delay of the torque behind the motion, and what it adds to B and I."""
    c = s.counters[0]
    response = intrinsic_response(p, s)
    delays = np.arange(-LARGEST_DELAY, LARGEST_DELAY + DELAY_STEP / 2.0, DELAY_STEP)
    misfit = behind_delay(response, s.solution[0], delays)[2]
    best = int(np.clip(np.argmin(misfit), 1, len(delays) - 2))
    before, least, after = misfit[best - 1 : best + 2]
    bend = before + after - 2.0 * least
    shift = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    delay = np.array([delays[best] + DELAY_STEP * np.clip(shift, -1.0, 1.0)])
    damping, inertia, _ = behind_delay(response, s.solution[0], delay)
    c["delay"] = delay[0]
    c["added_damping"] = damping[0] - s.solution[1]
    c["added_inertia"] = inertia[0] - s.solution[2]


def _halves_apart(p: Plan, s: State) -> float:
    """Return the larger difference of K or G between both halves of the memory, over its error."""
    c = s.counters[0]
    half = int(c["length"]) // 2
    if half < SHORTEST_HALF_MEMORY * p.second:
        return 0.0
    ring = s.ring[c["model"]]
    newest = (c["newest"] - np.arange(2 * half)) % len(ring)
    values, variances = [], []
    for blocks in (newest[:half], newest[half:]):
        memory = memory_of(p, s, ring[blocks].sum(axis=0), half)
        normal = normal_equations(s, memory, s.nuisance.combine)
        found = solve(s, normal, memory.samples, float(c["variance"]))
        values.append(found.gains)
        variances.append(np.diag(found.covariance)[[0, INTRINSIC]])
    scatter = np.maximum(s.scatter[c["model"], [0, GAINS - 1]], 1.0)
    error = np.sqrt(c["variance"] * scatter * (variances[0] + variances[1]))
    return float(np.max(np.abs(values[0] - values[1]) / error))
