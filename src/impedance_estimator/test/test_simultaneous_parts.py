"""Parts of the simultaneous estimator: regression, change detection, reflex shapes and noise
models, each against NumPy, SciPy or known truth.
"""

import math

import numpy as np
import pytest
from numba import njit
from scipy import signal

from impedance_estimator.simultaneous import reflex_shapes
from impedance_estimator.simultaneous.change_detection import (
    MIN_OLDER_BLOCKS,
    OVERLAP_BLOCKS,
    candidate_windows,
    find_change,
)
from impedance_estimator.simultaneous.cholesky import solve_scaled
from impedance_estimator.simultaneous.doubt import LIMITS, SIGNS, reasons
from impedance_estimator.simultaneous.explained_motion import (
    Memory,
    chosen_terms,
    combination,
    eliminated,
    explained,
    signals_of,
)
from impedance_estimator.simultaneous.noise_model_choice import lowest_corner
from impedance_estimator.simultaneous.nuisance import (
    EXTRAS,
    RELAXATION,
    TAPS,
    accumulate,
    packed_size,
    reduce_sums,
)
from impedance_estimator.simultaneous.regression import GAINS, solve_with_prior
from impedance_estimator.simultaneous.torque_delay import FREQUENCIES, behind_delay
from impedance_estimator.simultaneous.voluntary_torque_noise import (
    NOISE_MODELS,
    passband_gain,
    whitening_filters,
)

BLOCK = 16
NOISE = 0.1
JUMP_PRECISION = np.full(GAINS, 1e-2)
BEFORE, AFTER = np.array([1.0, 2.0, 3.0, 4.0]), np.array([1.3, 2.0, 3.0, 4.4])


@njit
def solved(normal, size, precision, mean):
    solution, covariance = np.zeros(size), np.zeros((size, size))
    determinant = solve_with_prior(normal, size, precision, mean, solution, covariance)
    return solution, covariance, determinant


@njit
def changed(ring, length, left_over, windows, total):
    # The recorded signals are the regressors themselves, and nothing is taken off the torque.
    combine = np.zeros((5, 4))
    for i in range(4):
        combine[i, i] = 1.0
    return find_change(
        ring,
        len(ring) - 1,
        length,
        left_over,
        windows,
        total,
        JUMP_PRECISION,
        BLOCK,
        combine,
    )[:2]


def regression(random, count, truth):
    regressors = random.normal(size=(count, len(truth)))
    return np.column_stack([regressors, regressors @ truth + NOISE * random.normal(size=count)])


def recorded(z, x, torque):
    """Sums as the estimator records them, without Z'X where the instruments are the motion."""
    upper = np.triu_indices(z.shape[1])
    kept = [(z.T @ z)[upper], z.T @ torque, [torque @ torque]]
    return np.concatenate(kept if x is z or np.array_equal(x, z) else [*kept, (z.T @ x).ravel()])


def memory(seed, changed_at, blocks):
    """Packed sums of every block, and the normal matrix of all."""
    random = np.random.default_rng(seed)
    data = np.concatenate(
        [
            regression(random, changed_at * BLOCK, BEFORE),
            regression(random, (blocks - changed_at) * BLOCK, AFTER),
        ]
    )
    ring = np.array(
        [recorded(part[:, :4], part[:, :4], part[:, 4]) for part in np.split(data, blocks)]
    )
    return ring, data.T @ data


@njit
def added_up(z, x, torque, both, size):
    sums = np.ones(size)
    accumulate(sums, np.column_stack((z, torque, x)), z.shape[1], both)
    return sums


@njit
def reduced(sums, combine):
    rows = combine.shape[0]
    normal = np.zeros((rows, rows))
    reduce_sums(sums, combine, normal)
    return normal


@njit
def solved_scaled(matrix, right):
    known, determinant = solve_scaled(matrix, 0.0, right)
    return known, determinant


@njit
def late_joint(response, stiffness, delay):
    turns = np.exp(2j * np.pi * FREQUENCIES * delay)
    return behind_delay(response, stiffness, turns)


@njit
def without_terms(instruments, cross, square, count, chosen):
    _, projection, sums = explained(Memory(instruments, cross, square, count), True)
    terms, widths = signals_of(chosen, len(sums))
    _, gamma = eliminated(sums, terms, widths, 1e-12)
    return sums, gamma, combination(projection, gamma)


def test_a_system_of_equations_is_solved_at_any_scale_and_refused_where_it_is_not_definite():
    random = np.random.default_rng(8)
    root = random.normal(size=(40, 9)) * 10.0 ** np.arange(-4, 5)
    matrix, right = root.T @ root, random.normal(size=(9, 3))
    solution = right.copy()
    known, determinant = solved_scaled(matrix, solution)
    assert known
    scale = np.sqrt(np.diag(matrix))[:, None]
    np.testing.assert_allclose(solution * scale, np.linalg.solve(matrix, right) * scale, rtol=1e-9)
    assert determinant == pytest.approx(np.linalg.slogdet(matrix)[1])
    assert not solved_scaled(np.array([[1.0, 2.0], [2.0, 1.0]]), np.eye(2))[0]
    assert not solved_scaled(np.array([[1.0, np.nan], [np.nan, 1.0]]), np.eye(2))[0]


def test_recorded_sums_are_combined_as_the_signals_would_be():
    random = np.random.default_rng(4)
    z, x, torque = random.normal(size=(50, 5)), random.normal(size=(50, 5)), random.normal(size=50)
    sums = added_up(z, x, torque, True, packed_size(5))
    np.testing.assert_allclose(sums, recorded(z, x, torque), atol=1e-12)
    # Without a reference the motion is its own instrument, and has no sums of its own.
    alone = added_up(z, x, torque, False, packed_size(5))
    np.testing.assert_array_equal(alone, np.where(np.arange(len(sums)) < len(sums) - 25, sums, 0.0))
    combine = random.normal(size=(4, 5))
    signals = np.column_stack([z @ combine[:3].T, torque - z @ combine[3]])
    np.testing.assert_allclose(reduced(sums, combine), signals.T @ signals, atol=1e-10)


def test_a_delay_of_the_torque_is_found_and_b_and_i_are_those_of_the_joint():
    omega = 2.0 * np.pi * FREQUENCIES
    for delay in (-0.0031, 0.0, 0.0074):
        joint = 80.0 + 0.7j * omega - 0.012 * omega**2
        delays = np.arange(-0.010, 0.0101, 0.0001)
        response = joint * np.exp(-1j * omega * delay)
        damping, inertia, misfit = np.array([late_joint(response, 80.0, d) for d in delays]).T
        best = int(np.argmin(misfit))
        assert delays[best] == pytest.approx(delay, abs=1e-9)
        assert (damping[best], inertia[best]) == pytest.approx((0.7, 0.012))
        assert misfit[best] < 1e-9
        assert misfit.max() > 0.1


@pytest.mark.slow
def test_explained_motion_is_free_of_what_the_instrument_does_not_carry():
    """A regression on motion that the torque's noise has moved is biased; on the part that the
    instrument explains it is not.
    """
    random = np.random.default_rng(6)
    count, size = 50_000, EXTRAS + 3
    z = random.normal(size=(count, size))
    noise = random.normal(size=count)
    x = z + np.column_stack([0.5 * noise, np.zeros((count, size - 1))])
    torque = 2.0 * x[:, 0] + noise
    chosen = chosen_terms(*range(TAPS), RELAXATION)
    cross = z.T @ np.column_stack([x, torque])
    sums, gamma, combine = without_terms(z.T @ z, cross, torque @ torque, float(count), chosen)
    assert sums[0, -1] / sums[0, 0] == pytest.approx(2.0, abs=0.02)
    assert (x[:, 0] @ torque) / (x[:, 0] @ x[:, 0]) > 2.3
    # A nuisance term takes its share: what is left does not depend on it.
    base = size - EXTRAS
    assert combine.shape == (base + 1, size)
    assert np.count_nonzero(gamma[:, 0]) == TAPS + 1


def test_signs_of_doubt_at_their_limits_are_reasons():
    assert reasons(np.zeros(len(SIGNS))) == ""
    for k, limit in enumerate(LIMITS):
        signs = np.zeros(len(SIGNS))
        signs[k] = limit
        assert reasons(signs)
        assert ";" not in reasons(signs)
    assert reasons(LIMITS).count(";") == len(SIGNS) - 1


def test_solution_covariance_and_determinant_are_numpys():
    random = np.random.default_rng(1)
    data = regression(random, 200, BEFORE) * [1.0, 1e-2, 1e2, 1.0, 1.0]
    normal, precision, mean = (
        data.T @ data,
        np.array([1e-3, 2.0, 5.0, 0.1]),
        np.array([0.0, 10.0, 0.1, 3.0]),
    )
    solution, covariance, determinant = solved(normal, 4, precision, mean)
    matrix = normal[:4, :4] + np.diag(precision)
    np.testing.assert_allclose(
        solution, np.linalg.solve(matrix, normal[:4, 4] + precision * mean), rtol=1e-9
    )
    np.testing.assert_allclose(covariance, np.linalg.inv(matrix), rtol=1e-7, atol=1e-15)
    assert determinant == pytest.approx(np.linalg.slogdet(matrix)[1])


def test_a_singular_system_is_refused():
    row = np.array([[1.0, 2.0, 3.0, 4.0, 5.0]])
    *_, determinant = solved(row.T @ row, 4, np.zeros(4), np.zeros(4))
    assert math.isnan(determinant)


@pytest.mark.parametrize("since", [8, 11, 21])
def test_a_change_is_placed_where_it_was(since):
    blocks = 60
    ring, total = memory(since, blocks - since, blocks)
    window, d = changed(ring, blocks, 0, candidate_windows(blocks), total)
    assert window == since
    # Expected D: the jump over its standard error, squared, within the window.
    assert (
        d
        > 0.5 * np.sum((AFTER - BEFORE) ** 2) / NOISE**2 * since * BLOCK * (blocks - since) / blocks
    )


def test_without_a_change_the_statistic_stays_low():
    largest = []
    for seed in range(200):
        ring, total = memory(seed, 60, 60)
        largest.append(changed(ring, 60, 0, candidate_windows(60), total)[1])
    # Chi-square with four degrees of freedom has 1 % above 13; the largest of eight dependent
    # windows a little more.
    assert np.percentile(largest, 50) < 13.0
    assert max(largest) < 40.0


@pytest.mark.parametrize("left", [1, 3, 8])
def test_what_is_left_over_from_before_a_change_is_found(left):
    blocks = 30
    ring, total = memory(left, left, blocks)
    window, d = changed(ring, blocks, OVERLAP_BLOCKS[0], candidate_windows(320), total)
    assert window == blocks - left
    assert d > 100.0
    # No more than may be left over; and too short to count as an older part otherwise.
    assert changed(ring, blocks, left - 1, candidate_windows(320), total)[0] != blocks - left
    assert left < MIN_OLDER_BLOCKS
    assert left in OVERLAP_BLOCKS
    assert changed(ring, blocks, 0, candidate_windows(320), total)[0] != blocks - left


@pytest.mark.parametrize("omega", [8.0, 15.0, 30.0])
@pytest.mark.parametrize("z", [0.6, 0.8, 1.0])
@pytest.mark.parametrize("delay", [0.035, 0.055])
def test_reflex_shapes_have_unit_area_and_lie_in_the_basis(omega, z, delay):
    step = 1.0 / 256.0
    lags = np.arange(round(reflex_shapes.LENGTH / step)) * step
    h = reflex_shapes.shape(np.array([math.log(omega), math.log(z), delay]), lags)
    # The slowest has 2 % of its area behind the end.
    assert np.sum(h) * step == pytest.approx(1.0, abs=2e-3 if omega > 8.0 else 0.03)
    # Against the undelayed response of SciPy, at the lags that are well behind the kink.
    time, response = signal.impulse(
        ([omega**2], [1.0, 2.0 * z * omega, omega**2]), T=np.arange(0.0, 0.8, 1e-4)
    )
    behind = lags > delay + 2.0 * step
    np.testing.assert_allclose(
        h[behind], np.interp(lags[behind] - delay, time, response), atol=0.02 * response.max()
    )
    functions = reflex_shapes.basis(step)
    missed = h - (h @ functions.T) @ functions
    assert missed @ missed < 3e-4 * (h @ h)


@pytest.mark.parametrize("model", range(len(NOISE_MODELS)))
def test_whitening_makes_its_own_noise_white(model):
    """Noise with the density 1 + (f_c / f)^2p, made in the frequency domain, comes out with the
    same density at all frequencies.
    """
    rate, count = 256.0, 2**16
    corner, order = NOISE_MODELS[model]
    frequency = np.fft.rfftfreq(count, 1.0 / rate)
    amplitude = np.sqrt(1.0 + (corner / np.maximum(frequency, 0.1 * corner)) ** (2 * order))
    white = np.random.default_rng(model).normal(size=count)
    sections = whitening_filters(rate)[model]
    out = signal.sosfilt(sections, np.fft.irfft(np.fft.rfft(white) * amplitude, count))[
        count // 4 :
    ]
    found, density = signal.welch(out, rate, nperseg=8192)
    low, high = (
        density[(found > 0.3 * corner) & (found < 2.0 * corner)],
        density[(found > 20.0) & (found < 100.0)],
    )
    assert np.mean(low) == pytest.approx(np.mean(high), rel=0.35)
    # First impulse response sample one: the residual is the one-step prediction error.
    assert signal.sosfilt(sections, np.eye(1, 8)[0])[0] == pytest.approx(1.0)
    assert passband_gain(sections) == pytest.approx(1.0, rel=0.25)


@njit
def chosen_corner(compared, doubt, first, present):
    return lowest_corner(compared, doubt, first, present, 1)


def under_corners(low_error_of_k, low_error_of_g):
    """K, B, I, G and their variances under three corners; B and I do not count."""
    compared = np.ones((3, 2, GAINS))
    compared[:, 0, [0, 3]] = 90.0, 10.0
    compared[:, 1, [0, 3]] = np.square([(low_error_of_k, low_error_of_g), (1.0, 0.5), (1.0, 0.5)])
    return compared


@pytest.mark.parametrize("low_errors", [(6.0, 0.5), (1.0, 3.0)])
def test_a_higher_corner_is_chosen_where_the_low_one_costs_much(low_errors):
    assert chosen_corner(under_corners(*low_errors), 0.0, 0, 0) == 1
    assert chosen_corner(under_corners(1.0, 0.5), 0.0, 0, 1) == 0


@pytest.mark.parametrize("low_errors", [(2.2, 0.5), (1.0, 1.1)])
def test_where_the_model_does_not_hold_a_smaller_standard_error_is_worth_less(low_errors):
    """On a real ankle stress relaxes, which becomes stiffness behind a higher corner."""
    assert chosen_corner(under_corners(*low_errors), 1.0, 0, 1) == 0
    assert chosen_corner(under_corners(*low_errors), 0.0, 0, 1) == 1
    # Right after a change the low corner is not at hand.
    assert chosen_corner(under_corners(*low_errors), 1.0, 1, 1) == 1


def test_noise_that_hides_the_slow_part_of_a_response_makes_the_low_corner_useless_in_any_doubt():
    assert chosen_corner(under_corners(4.0, 2.0), 1.0, 0, 0) == 1


def test_before_anything_is_compared_the_corner_stays():
    assert chosen_corner(np.zeros((3, 2, GAINS)), 0.0, 1, 1) == 1
