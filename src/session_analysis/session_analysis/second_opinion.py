"""An offline second opinion on a recording: a nonparametric method on all of it, on its halves and
on disjoint stretches, and its frequency response.

The parallel cascade (Kearney, Stein & Parameswaran 1997) has no parametric form, so its values
arbitrate between estimators, and what it predicts of data that it was not fitted to is what a
linear intrinsic pathway and a reflex to rectified velocity can explain at all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import signal

from impedance_estimator.offline.parallel_cascade import ParallelCascade, parallel_cascade
from model_discrepancy.recording.recording import Recording
from session_analysis.errors import AnalysisError

STRETCH = 10.0
"""[s] Length of a disjoint stretch; twice the shortest record that the cascade takes."""
MIN_STRETCH = 6.0
"""[s] Length of the stretches of a record that is too short for three longer ones."""
MIN_STRETCHES = 3
"""Least number of stretches for a scatter, and so for a standard error."""
SEGMENT = 4.0
"""[s] Length of a segment of the spectra; resolves 0.25 Hz, and 60 s give 29 overlapping ones."""
MOVING_SHARE = 0.5
"""Least share of a stretch's seconds in which the plate moves. In a break nothing tells K and G:
one such stretch made the standard error of K eight times K."""
MIN_MOVEMENT = 1e-3
"""[rad] Standard deviation of the position about its mean of a second; sensor noise of a rig is
below 1e-4, perturbations are above 5e-3."""
BAND = (0.5, 40.0)
"""[Hz] Band in which the perturbation of the paper has power."""


@dataclass(frozen=True)
class FrequencyResponse:
    """Holds the frequency response from position to torque; all arrays have the shape (k,).

    Attributes
    ----------
    frequency
        [Hz].
    measured
        Complex stiffness [N.m/rad].
    model
        That of the fitted cascade's predicted torque [N.m/rad], by the same spectra.
    coherence
        Between position and torque, 0 to 1.
    instrument
        Whether the reference was the instrument, which keeps torque that moves a compliant servo
        out of the response.
    """

    frequency: np.ndarray
    measured: np.ndarray
    model: np.ndarray
    coherence: np.ndarray
    instrument: bool


@dataclass(frozen=True)
class SecondOpinion:
    """Holds the result of the offline method.

    Attributes
    ----------
    K, G
        (value, standard error) over the whole recording [N.m/rad, N.m.s/rad]; the error is NaN
        where too few stretches tell a scatter.
    halves_K, halves_G
        (value, standard error) of the first and the second half.
    held_out_vaf
        Variance of one half's torque accounted for by the fit of the other [%], both ways.
    response
        Frequency response.
    """

    K: tuple[float, float]
    G: tuple[float, float]
    halves_K: tuple[tuple[float, float], tuple[float, float]]
    halves_G: tuple[tuple[float, float], tuple[float, float]]
    held_out_vaf: tuple[float, float]
    response: FrequencyResponse


def movements(position: np.ndarray, rate: float) -> np.ndarray:
    """Return the standard deviation of a position about its mean of each second.

    Parameters
    ----------
    position
        [rad], shape (n,).
    rate
        Sampling rate [Hz].

    Returns
    -------
    numpy.ndarray
        [rad], one value for each second without a gap; a single 0 where there is none.
    """
    length = max(2, min(round(rate), len(position)))
    pieces = position[: len(position) // length * length].reshape(-1, length)
    finite = np.isfinite(pieces).all(axis=1)
    return np.asarray(pieces[finite].std(axis=1)) if finite.any() else np.zeros(1)


def second_opinion(recording: Recording) -> SecondOpinion:
    """Fit the parallel cascade to a recording and to its parts.

    Parameters
    ----------
    recording
        Evenly sampled, with at least 12 s and movement.

    Raises
    ------
    AnalysisError
        It is too short, not finite, or does not move.
    """
    position, torque, velocity = recording.position, recording.torque, recording.velocity
    largest = float(np.max(movements(position, recording.rate)))
    if largest < MIN_MOVEMENT:
        raise AnalysisError(
            f"the position moves by no more than {largest:.2g} rad within a second: no "
            "perturbation to learn from"
        )
    middle = len(position) // 2
    parts = (slice(0, middle), slice(middle, None))

    def fit(part: slice) -> ParallelCascade:
        try:
            own = None if velocity is None else velocity[part]
            return parallel_cascade(recording.rate, position[part], torque[part], own)
        except np.linalg.LinAlgError:
            raise AnalysisError("position does not vary: no perturbation to learn from") from None

    whole, first, second = fit(slice(None)), fit(parts[0]), fit(parts[1])
    vaf = tuple(
        model.predict(
            position[part], torque[part], None if velocity is None else velocity[part]
        ).vaf
        for model, part in ((second, parts[0]), (first, parts[1]))
    )
    errors = [_errors(fit, part, recording) for part in (slice(None), *parts)]
    response = _response(recording, whole)
    return SecondOpinion(
        (whole.stiffness, errors[0][0]),
        (whole.gain, errors[0][1]),
        ((first.stiffness, errors[1][0]), (second.stiffness, errors[2][0])),
        ((first.gain, errors[1][1]), (second.gain, errors[2][1])),
        (vaf[0], vaf[1]),
        response,
    )


def _errors(
    fit: Callable[[slice], ParallelCascade], part: slice, recording: Recording
) -> tuple[float, float]:
    """Return the standard errors of K and G from the scatter of disjoint stretches in which the
    plate moves.
    """
    position, rate = recording.position, recording.rate
    start, stop, _ = part.indices(len(position))
    share = (stop - start) / rate / MIN_STRETCHES
    length = int(min(STRETCH, max(MIN_STRETCH, share)) * rate)
    stretches = [slice(begin, begin + length) for begin in range(start, stop - length + 1, length)]
    moving = [one for one in stretches if _moves(position[one], rate)]
    if len(moving) < MIN_STRETCHES:
        return float("nan"), float("nan")
    fits = [fit(one) for one in moving]
    values = np.array([(one.stiffness, one.gain) for one in fits])
    spread = values.std(axis=0, ddof=1) / np.sqrt(len(values))
    return float(spread[0]), float(spread[1])


def _moves(position: np.ndarray, rate: float) -> bool:
    """Say whether the plate moves in enough seconds of a stretch to tell K and G."""
    return float(np.mean(movements(position, rate) >= MIN_MOVEMENT)) >= MOVING_SHARE


def _response(recording: Recording, model: ParallelCascade) -> FrequencyResponse:
    predicted = model.predict(recording.position, recording.torque, recording.velocity)
    step = float(np.mean(np.diff(predicted.time)))
    times = predicted.time
    clock = np.arange(len(recording.position)) / recording.rate
    x = np.interp(times, clock, recording.position)
    r = None if recording.reference is None else np.interp(times, clock, recording.reference)
    instrument = r is not None and float(np.std(r)) > 0
    driver = r if instrument and r is not None else x
    options = {"fs": 1.0 / step, "nperseg": min(len(x), round(SEGMENT / step))}
    frequency, to_position = signal.csd(driver, x, **options)
    _, to_torque = signal.csd(driver, predicted.measured, **options)
    _, to_model = signal.csd(driver, predicted.torque, **options)
    with np.errstate(invalid="ignore", divide="ignore"):
        _, coherence = signal.coherence(x, predicted.measured, **options)
    band = (frequency >= BAND[0]) & (frequency <= BAND[1]) & (np.abs(to_position) > 0)
    return FrequencyResponse(
        frequency[band],
        to_torque[band] / to_position[band],
        to_model[band] / to_position[band],
        coherence[band],
        bool(instrument),
    )
