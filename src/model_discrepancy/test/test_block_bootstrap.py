"""Standard errors from stretches."""

import numpy as np

from model_discrepancy.fit.block_bootstrap import bootstrap_changes

RATE = 200.0
COUNT = 12_000


def _formula(derivatives: np.ndarray, residual: np.ndarray) -> np.ndarray:
    variance = residual @ residual / (len(residual) - derivatives.shape[1])
    return np.sqrt(np.diag(np.linalg.inv(derivatives.T @ derivatives)) * variance)


def test_white_residuals_give_what_least_squares_gives() -> None:
    random = np.random.default_rng(1)
    derivatives = random.standard_normal((COUNT, 3)) * [1.0, 10.0, 0.1]
    residual = random.standard_normal(COUNT)
    drawn = bootstrap_changes(derivatives, residual, np.ones(COUNT, bool), RATE).std(axis=0)
    np.testing.assert_allclose(drawn, _formula(derivatives, residual), rtol=0.35)


def test_a_parameter_that_changes_over_the_recording_is_less_certain_than_least_squares_says() -> (
    None
):
    random = np.random.default_rng(2)
    derivatives = random.standard_normal((COUNT, 1))
    drift = np.repeat(random.standard_normal(COUNT // 1200), 1200)
    residual = drift * derivatives[:, 0] + random.standard_normal(COUNT)
    drawn = bootstrap_changes(derivatives, residual, np.ones(COUNT, bool), RATE).std(axis=0)
    assert drawn[0] > 3 * _formula(derivatives, residual)[0]


def test_rows_that_were_not_fitted_do_not_count() -> None:
    random = np.random.default_rng(3)
    derivatives, residual = random.standard_normal((COUNT, 2)), random.standard_normal(COUNT)
    used = np.arange(COUNT) < COUNT // 2
    wild = np.where(used, residual, 1e6)
    np.testing.assert_array_equal(
        bootstrap_changes(derivatives, wild, used, RATE),
        bootstrap_changes(derivatives, residual, used, RATE),
    )


def test_too_few_stretches_say_nothing() -> None:
    assert np.isnan(
        bootstrap_changes(np.ones((800, 2)), np.ones(800), np.ones(800, bool), RATE)
    ).all()
