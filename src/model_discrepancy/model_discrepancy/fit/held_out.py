"""VAF on data that was not used for fitting: train on one half, score on the other, both ways.

The halves are the first and the second one in time, which a drift must continue, unless others are
given.

Fitted and scored by the plain error, as VAF is; the whitened error decides in the search, not here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.halves import first_and_second
from model_discrepancy.fit.movements import BANDS_HZ, WINDOWS_S, find_onsets
from model_discrepancy.fit.parallel import in_parallel

BLOCK_S = 5.0


@dataclass(frozen=True)
class HeldOut:
    """Holds the VAF [%] on unseen rows.

    Attributes
    ----------
    vaf
        Mean of both directions.
    both
        Each direction: trained on the first half, trained on the second half.
    windows, bands, blocks
        By window after movements, frequency band, and 5 s block.
    residual
        Plain residual [N.m] where each row was predicted from the other half, shape (rows.count,).
    """

    vaf: float
    both: tuple[float, float]
    windows: dict[tuple[float, float], float]
    bands: dict[tuple[float, float], float]
    blocks: np.ndarray
    residual: np.ndarray


def held_out(
    problem: Fitter,
    fit: Fit,
    evaluations: int = 15,
    parts: tuple[np.ndarray, np.ndarray] | None = None,
) -> HeldOut:
    """Refit the fit's terms on each half by the plain error and score on the other.

    Parameters
    ----------
    problem
        Of the recording.
    fit
        The model.
    evaluations
        Of each refit, at most.
    parts
        Masks of the two halves, each bool of shape (rows.count,); None: the first and the second
        half in time.
    """
    fitter = problem.unwhitened()
    rows = fitter.rows
    parts = parts or first_and_second(rows)
    residual = np.zeros(rows.count)
    both = []
    trained = in_parallel(
        lambda train: fitter.fit(fit.terms, fit.values, mask=train, evaluations=evaluations), parts
    )
    for other, test in zip(trained, parts[::-1], strict=True):
        both.append(vaf(fitter.plain_target[test], other.plain[test]))
        residual[test] = other.plain[test]
    scored = parts[0] | parts[1]
    return HeldOut(
        float(np.mean(both)),
        (both[0], both[1]),
        _by_window(fitter, residual, scored),
        _by_band(fitter, residual, scored),
        _by_block(fitter, residual, scored),
        residual,
    )


def vaf(torque: np.ndarray, residual: np.ndarray) -> float:
    """Return the variance accounted for [%] (van 't Veld et al. 2018, equation 1)."""
    return 100.0 * (1.0 - float(np.var(residual)) / float(np.var(torque)))


def _by_window(
    fitter: Fitter, residual: np.ndarray, scored: np.ndarray
) -> dict[tuple[float, float], float]:
    rows = fitter.rows
    onsets = find_onsets(fitter.columns).time
    found = {}
    for window in WINDOWS_S:
        inside = np.zeros(rows.count, dtype=bool)
        for time in onsets:
            inside[
                max(int((time + window[0]) * rows.rate), 0) : max(
                    int((time + window[1]) * rows.rate), 0
                )
            ] = True
        inside &= scored
        if inside.sum() > 50:
            found[window] = vaf(fitter.plain_target[inside], residual[inside])
    return found


def _by_band(
    fitter: Fitter, residual: np.ndarray, scored: np.ndarray
) -> dict[tuple[float, float], float]:
    frequency = np.fft.rfftfreq(fitter.rows.count, 1.0 / fitter.rows.rate)
    torque, error = (
        np.abs(np.fft.rfft(np.where(scored, s, 0.0))) ** 2 for s in (fitter.plain_target, residual)
    )
    found = {}
    for b in BANDS_HZ:
        inside = (frequency >= b[0]) & (frequency < b[1])
        found[b] = 100.0 * (1.0 - float(error[inside].sum() / torque[inside].sum()))
    return found


def _by_block(fitter: Fitter, residual: np.ndarray, scored: np.ndarray) -> np.ndarray:
    block = (fitter.rows.time / BLOCK_S).astype(int)
    values = []
    for number in range(int(block.max()) + 1):
        inside = (block == number) & scored
        if inside.sum() > 100:
            values.append(vaf(fitter.plain_target[inside], residual[inside]))
    return np.array(values)
