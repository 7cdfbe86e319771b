"""Filters, differences, regressions: each against SciPy, NumPy or an exact answer."""

import numpy as np
import pytest
from scipy import linalg, signal

from impedance_estimator import digital_filters as filters
from impedance_estimator.correlation.differences import LENGTH, backward_difference, difference_step
from impedance_estimator.correlation.intrinsic_regression import (
    COLLINEAR,
    NO_VARIANCE,
    SOLVED,
    solve_intrinsic,
)
from impedance_estimator.correlation.reflex_response import decimation, lags, solve_toeplitz
from impedance_estimator.correlation.running_products import (
    PRODUCTS,
    add_products,
    average_products,
)
from impedance_estimator.standard_errors import (
    MOMENTS,
    average_batch,
    intrinsic_variance,
    reflex_variance,
)

DESIGNS = {
    "butterworth": filters.butterworth_lowpass(4, 100.0, 2048.0),
    "bessel": filters.bessel_lowpass(2, 0.04, 128.0),
    "highpass": filters.highpass(0.033, 2048.0),
    "none": filters.NO_FILTER,
}


@pytest.mark.parametrize("sections", DESIGNS.values(), ids=DESIGNS.keys())
def test_filter_step_is_scipys_sosfilt(sections):
    u = np.random.default_rng(1).normal(size=(500, 3))
    state = filters.filter_state(sections, 3)
    y = np.empty_like(u)
    for n in range(len(u)):
        values = u[n].copy()
        filters.filter_step(sections, state, values, 3)
        y[n] = values
    expected = signal.sosfilt(sections, u, axis=0) if len(sections) else u
    np.testing.assert_allclose(y, expected, atol=1e-12)


@pytest.mark.parametrize("sections", DESIGNS.values(), ids=DESIGNS.keys())
def test_settled_filter_passes_a_constant_without_transient(sections):
    state = filters.filter_state(sections, 2)
    first = np.array([3.0, -7.0])
    filters.settle_filter(sections, state, first)
    for _ in range(50):
        values = np.array([3.0, -7.0])
        filters.filter_step(sections, state, values, 2)
        np.testing.assert_allclose(values, first, atol=1e-7)


def test_cutoffs_are_where_they_are_said_to_be():
    for sections in (filters.butterworth_lowpass(2, 5.0, 500.0), filters.highpass(5.0, 500.0)):
        _, response = signal.sosfreqz(sections, [5.0], fs=500.0)
        assert abs(response[0]) == pytest.approx(np.sqrt(0.5), rel=1e-6)
    _, response = signal.sosfreqz(filters.bessel_lowpass(2, 5.0, 5000.0), [5.0], fs=5000.0)
    assert np.angle(response[0]) == pytest.approx(-np.pi / 2, rel=1e-3)


def test_weight_energy():
    # Noise bandwidth of an n-th order Butterworth filter: cutoff * (pi / 2n) / sin(pi / 2n),
    # one-sided.
    expected = 2 * 0.025 * (np.pi / 4) / np.sin(np.pi / 4)
    assert filters.weight_energy(
        filters.butterworth_lowpass(2, 0.025, 128.0), 128.0
    ) == pytest.approx(expected, rel=1e-3)
    # Two first-order low-passes: w(t) = t exp(-t/T) / T^2, whose square integrates to 1 / (4 T).
    assert filters.weight_energy(filters.exponential_average(0.1, 500.0), 500.0) == pytest.approx(
        2 * np.pi * 0.1 / 4, rel=1e-3
    )


def test_weights_of_the_variance_average_are_nowhere_negative():
    impulse = np.zeros(60_000)
    impulse[0] = 1.0
    assert signal.sosfilt(filters.exponential_average(0.025, 128.0), impulse).min() >= 0.0
    assert signal.sosfilt(filters.butterworth_lowpass(2, 0.025, 128.0), impulse).min() < 0.0


def differentiate(order, values, rate):
    weights, history = backward_difference(order, rate), np.zeros(LENGTH)
    return np.array([difference_step(weights, history, value) for value in values])[LENGTH:]


@pytest.mark.parametrize("order", [1, 4])
def test_difference_is_exact_up_to_its_order(order):
    t = np.arange(40) / 100.0
    for power in range(order + 1):
        expected = power * t[LENGTH:] ** max(power - 1, 0)
        np.testing.assert_allclose(differentiate(order, t**power, 100.0), expected, atol=1e-10)


@pytest.mark.parametrize("order", [1, 4])
def test_difference_error_shrinks_with_its_order(order):
    errors = []
    for rate in (200.0, 400.0):
        t = np.arange(int(rate)) / rate
        errors.append(
            np.abs(differentiate(order, np.sin(20 * t), rate) - 20 * np.cos(20 * t[LENGTH:])).max()
        )
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)


def test_other_difference_orders_are_refused():
    with pytest.raises(ValueError, match="order 3 is not available; allowed: 1, 4"):
        backward_difference(3, 1000.0)


def averaged(signals):
    sums, averages = np.zeros(PRODUCTS), np.zeros(PRODUCTS)
    sections = filters.butterworth_lowpass(2, 10.0, 1000.0)
    state = filters.filter_state(sections, PRODUCTS)
    for chunk in np.split(signals, len(signals) // 10):
        for sample in chunk:
            add_products(sums, sample)
        average_products(sections, state, averages, sums)
        assert not sums.any()
    return averages


def test_intrinsic_parameters_are_exact_without_noise_in_spite_of_scale():
    s = np.random.default_rng(2).normal(size=(2000, 4)) * [0.01, 0.5, 100.0, 1.0]
    s[:, 3] = s[:, :3] @ [100.0, 0.63, 0.0137]
    parameters, inverse = np.zeros(3), np.zeros((3, 3))
    averages = averaged(s)
    assert solve_intrinsic(averages, parameters, inverse) == SOLVED
    np.testing.assert_allclose(parameters, [100.0, 0.63, 0.0137], rtol=1e-9)
    normal = np.array(
        [
            [averages[0], *averages[1:3]],
            [averages[1], *averages[4:6]],
            [averages[2], averages[5], averages[7]],
        ]
    )
    np.testing.assert_allclose(inverse @ normal, np.eye(3), atol=1e-8)


def test_one_frequency_does_not_separate_stiffness_from_inertia():
    t = np.arange(4000) / 1000.0
    s = np.column_stack(
        [np.sin(30 * t), 30 * np.cos(30 * t), -900 * np.sin(30 * t), np.sin(30 * t)]
    )
    parameters, inverse = np.array([1.0, 2.0, 3.0]), np.eye(3)
    assert solve_intrinsic(averaged(s), parameters, inverse) == COLLINEAR
    assert solve_intrinsic(np.zeros(PRODUCTS), parameters, inverse) == NO_VARIANCE
    np.testing.assert_array_equal(parameters, [1.0, 2.0, 3.0])


@pytest.mark.parametrize("n", [1, 2, 7, 47])
def test_levinson_is_scipys_toeplitz_solution(n):
    rng = np.random.default_rng(n)
    column = signal.correlate(x := rng.normal(size=500), x, "full")[499 : 499 + n] / 500
    right = rng.normal(size=n)
    solution, row_sums = np.zeros(n), np.zeros(n)
    assert solve_toeplitz(column, right, solution, row_sums, np.zeros((2, n)))
    np.testing.assert_allclose(solution, linalg.solve_toeplitz(column, right), rtol=1e-9)
    np.testing.assert_allclose(row_sums, linalg.solve_toeplitz(column, np.ones(n)), rtol=1e-9)


@pytest.mark.parametrize(
    "column", [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [1.0, -2.0, 0.0], [np.nan, 0.0, 0.0]]
)
def test_levinson_refuses_what_is_not_positive_definite(column):
    assert not solve_toeplitz(
        np.array(column), np.ones(3), np.zeros(3), np.zeros(3), np.zeros((2, 3))
    )


@pytest.mark.parametrize(
    ("rate", "factor"), [(500.0, 4), (1000.0, 8), (2048.0, 16), (10_000.0, 78)]
)
def test_decimated_lags_cover_40_to_400_ms_at_every_rate(rate, factor):
    assert decimation(rate) == factor
    times = lags(0.04, 0.4, rate / factor) * factor / rate
    assert times[0] == pytest.approx(0.04, abs=0.5 * factor / rate)
    assert times[-1] == pytest.approx(0.4, abs=0.5 * factor / rate)


def test_batch_means_give_the_variance_of_an_average_of_coloured_noise():
    """Scores that are an AR(1) sequence: the spread of many averages is what the batches of one of
    them say.
    """
    rng = np.random.default_rng(5)
    batch, batches, runs = 200, 60, 200
    scores = signal.lfilter([1.0], [1.0, -0.9], rng.normal(size=(runs, batch * batches)), axis=1)
    spread = scores.mean(axis=1).var()
    sections = filters.exponential_average(0.01, 1.0)
    predicted = []
    for run in scores[:40]:
        state, moments = filters.filter_state(sections, MOMENTS), np.zeros(MOMENTS)
        for part in run.reshape(batches, batch):
            average_batch(sections, state, moments, np.full(4, part.mean()))
        variance = np.zeros(3)
        # The plain average over `batches` batches: T_b times its weight energy is 1 / batches.
        intrinsic_variance(moments, np.eye(3), 1.0, 1.0 / batches, variance)
        predicted.append(variance[0])
        assert reflex_variance(moments, 1.0, 1.0 / batches) == pytest.approx(variance[0])
    assert np.mean(predicted) == pytest.approx(spread, rel=0.25)
