"""Twice a second the memory is looked at as a whole.

What the reference explains of the motion is found anew and the nuisance terms are taken out
(`explained_motion`, `optional_terms`), the delay of the torque is stated (`torque_delay`), and
every `REVIEW_PERIOD` the signs of doubt are read (`doubt`): would a wider intrinsic response or
another structure make the memory more likely, and do its halves agree?
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from impedance_estimator.compilation import part
from impedance_estimator.simultaneous.block_update import MIN_SCATTER_LENGTH, prior_of_unknowns
from impedance_estimator.simultaneous.cholesky import solve_scaled
from impedance_estimator.simultaneous.doubt import STRUCTURE_GAINS, judge
from impedance_estimator.simultaneous.explained_motion import (
    ALL_TAPS,
    NO_TERM,
    Memory,
    chosen_terms,
    combination,
    eliminated,
    explained,
    memory_of,
    reduced_sums,
    signals_of,
)
from impedance_estimator.simultaneous.memory import add_blocks
from impedance_estimator.simultaneous.nuisance import CUBE, RELAXATION, SQUARE, YIELDING
from impedance_estimator.simultaneous.optional_terms import optional_terms
from impedance_estimator.simultaneous.regression import GAINS, INTRINSIC, PARAMETERS
from impedance_estimator.simultaneous.state import Plan, State
from impedance_estimator.simultaneous.torque_delay import state_delay

SKEW = chosen_terms(0, 1)
"""The accelerations one decimated sample later and earlier take up a delay; what the others explain
beside them is another response than that of inertia, viscosity and stiffness."""
STRUCTURES = np.array(
    [chosen_terms(RELAXATION), chosen_terms(YIELDING), chosen_terms(SQUARE, CUBE)]
)
"""Nuisance signals that would be relaxation, yielding, or powers of position."""
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
UNREFERENCED_FACTORS = np.array([1.0, 10.0, 7.0])
"""Without a reference the limits of relaxation, yielding and powers of position are higher by these
factors: a servo that gives way lets torque into the measured motion, whose yielding and powers then
gained up to 180 and 340 without a mismatch; relaxation gained up to 40, as with a reference."""
SHORTEST_HALF_MEMORY = 5.0
"""A half of the memory must be this long [s] to disagree with the other: a dozen perturbations."""
K_AND_G_PLACES = (0, GAINS - 1)
"""K and G among the unknowns."""


class Solution(NamedTuple):
    """Holds a regression: unknowns, their covariance, the evidence ln L for its model, and the sum
    of squares that it leaves.
    """

    unknowns: np.ndarray
    covariance: np.ndarray
    evidence: float
    left: float


@part
def normal_equations(s: State, memory: Memory, combine: np.ndarray) -> np.ndarray:
    """Return sums of products of the unknowns' signals and, last, the torque; shape (8, 8)."""
    base = combine.shape[0] - 1
    unknowns = np.zeros((base + 1, PARAMETERS + 1))
    for i in range(INTRINSIC):
        unknowns[i, i] = 1.0
    unknowns[INTRINSIC:base, INTRINSIC:PARAMETERS] = s.tangent
    unknowns[base, PARAMETERS] = 1.0
    return np.dot(unknowns.T, np.dot(reduced_sums(memory, combine), unknowns))


@part
def solve(
    s: State, normal: np.ndarray, count: float, variance: float, immaterial: float
) -> tuple[bool, Solution]:
    """Return whether the data determine the unknowns, and the regression over a stretch with
    ln p(data | prior) up to a constant, the noise at its most likely size, and a sum of squares
    that is `immaterial` beside it.
    """
    precision, mean = np.empty(PARAMETERS), np.empty(PARAMETERS)
    prior_of_unknowns(s, precision, mean)
    precision *= variance
    matrix = normal[:PARAMETERS, :PARAMETERS].copy()
    for i in range(PARAMETERS):
        matrix[i, i] += precision[i]
    inverse, unknowns = np.eye(PARAMETERS), np.zeros(PARAMETERS)
    known, determinant = solve_scaled(matrix, 0.0, inverse)
    for i in range(PARAMETERS):
        for j in range(PARAMETERS):
            unknowns[i] += inverse[i, j] * (normal[j, PARAMETERS] + precision[j] * mean[j])
    rest = normal[PARAMETERS, PARAMETERS]
    deviation = 0.0
    for i in range(PARAMETERS):
        row = -2.0 * normal[i, PARAMETERS]
        for j in range(PARAMETERS):
            row += normal[i, j] * unknowns[j]
        rest += unknowns[i] * row
        deviation += precision[i] * (unknowns[i] - mean[i]) ** 2
        determinant -= np.log(precision[i])
    noise = max(rest, 1e-300) + deviation + immaterial
    evidence = -0.5 * (count * np.log(noise / count) + determinant)
    return known, Solution(unknowns, inverse, evidence, rest)


@part
def clean_motion(p: Plan, s: State) -> None:
    """Find anew what of the motion the reference explains, and take the nuisance terms out.

    Called twice a second, before a block is added to the memory; every `REVIEW_PERIOD` the signs
    of doubt are read.
    """
    c = s.counters[0]
    if c.length < 1:
        return
    memory = memory_of(p, s, s.totals[c.model], c.length)
    variance = c.variance if np.isfinite(c.variance) else memory.square / memory.samples
    if not variance > 0.0:
        return
    found, projection, sums = explained(memory, c.referenced == 1)
    if not found:
        # Too few data: what was found before stays in use.
        return
    # What lies between joint and sensors is undone where a calibration tells it.
    known = np.isfinite(c.variance)
    taps, tap_widths = signals_of(NO_TERM if p.modelled_reflex else ALL_TAPS, sums.shape[0])
    terms, widths = optional_terms(p, s, sums)
    found, gamma = eliminated(
        sums, np.hstack((taps, terms)), np.concatenate((tap_widths, widths)), variance
    )
    if not found:
        return
    review = (
        known
        and c.length >= MIN_SCATTER_LENGTH * p.second
        and c.blocks % (REVIEW_PERIOD * p.second) == 0
    )
    if review and not _read_structure(p, s, memory, projection, sums):
        return
    s.nuisance.gamma[:] = gamma
    s.nuisance.combine[:] = combination(projection, gamma)
    if known and not p.modelled_reflex:
        state_delay(p, s)
    if review:
        s.signs[1] = _halves_apart(p, s)
        judge(s)


@part
def _read_structure(
    p: Plan, s: State, memory: Memory, projection: np.ndarray, sums: np.ndarray
) -> bool:
    """Set the signs `breadth` and `structure`: how much more likely (ln L) the memory is with a
    wider intrinsic response than that of I, B, K and the usual nuisance terms, and with the best of
    `STRUCTURES`, over its limit; return False where the data do not tell.
    """
    usual = NO_TERM if p.modelled_reflex else SKEW
    enough, plain = _with_terms(s, memory, projection, sums, usual)
    found, wider = _with_terms(s, memory, projection, sums, ALL_TAPS)
    enough = enough and found
    referenced = s.counters[0].referenced == 1
    largest = -np.inf
    for k in range(STRUCTURES.shape[0]):
        found, other = _with_terms(s, memory, projection, sums, usual | STRUCTURES[k])
        enough = enough and found
        limit = STRUCTURE_GAINS[k] * (1.0 if referenced else UNREFERENCED_FACTORS[k])
        largest = max(largest, (other.evidence - plain.evidence) / limit)
    if enough:
        matters = referenced or _matters(plain, wider, memory.square)
        s.signs[0] = wider.evidence - plain.evidence if matters else 0.0
        s.signs[2] = largest
    return enough


@part
def _with_terms(
    s: State, memory: Memory, projection: np.ndarray, sums: np.ndarray, terms: np.ndarray
) -> tuple[bool, Solution]:
    """Return whether the data tell the regression with some nuisance terms, and it."""
    variance = s.counters[0].variance
    signals, widths = signals_of(terms, sums.shape[0])
    found, gamma = eliminated(sums, signals, widths, variance)
    normal = normal_equations(s, memory, combination(projection, gamma))
    immaterial = IMMATERIAL_SHARE * memory.square
    determined, solution = solve(s, normal, memory.samples, variance, immaterial)
    return found and determined, solution


@part
def _matters(plain: Solution, wider: Solution, square: float) -> bool:
    """Say whether a wider intrinsic response explains enough of the torque, or changes K or G
    enough, to be more than noise of the measured motion.

    Several shifted accelerations in place of one average that noise away, which makes them as
    likely as a joint that is wider does.
    """
    matters = (plain.left - wider.left) / square > UNREFERENCED_SHARE
    for k in range(2):
        before, after = plain.unknowns[K_AND_G_PLACES[k]], wider.unknowns[K_AND_G_PLACES[k]]
        moved = abs(after - before) / max(abs(before), 1e-6)
        matters = matters or moved > UNREFERENCED_CHANGES[k]
    return matters


@part
def _halves_apart(p: Plan, s: State) -> float:
    """Return the larger difference of K or G between both halves of the memory, over its error; 0
    where a half does not tell them.
    """
    c = s.counters[0]
    half = c.length // 2
    if half < SHORTEST_HALF_MEMORY * p.second:
        return 0.0
    ring = s.ring[c.model]
    values, variances = np.empty((2, 2)), np.empty((2, 2))
    for part_of_memory in range(2):
        sums = np.zeros(ring.shape[1])
        add_blocks(sums, ring, c.newest, part_of_memory * half, (part_of_memory + 1) * half)
        memory = memory_of(p, s, sums, half)
        normal = normal_equations(s, memory, s.nuisance.combine)
        known, solution = solve(s, normal, memory.samples, c.variance, 0.0)
        if not known:
            return 0.0
        for k in range(2):
            values[part_of_memory, k] = solution.unknowns[K_AND_G_PLACES[k]]
            variances[part_of_memory, k] = solution.covariance[K_AND_G_PLACES[k], K_AND_G_PLACES[k]]
    apart = 0.0
    for k in range(2):
        scatter = max(s.scatter[c.model, K_AND_G_PLACES[k]], 1.0)
        error = np.sqrt(c.variance * scatter * (variances[0, k] + variances[1, k]))
        apart = max(apart, abs(values[0, k] - values[1, k]) / error)
    return apart
