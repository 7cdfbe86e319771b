"""Signals about two holds of one session, which figures 4 and 8 of the paper show."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfiltfilt

from ankle_interfaces.block import unpack
from emg_driver.muscles import SAMPLES_TOPIC
from emg_driver.offline import MOTION_TOPIC, REFERENCE_TOPIC, feed
from emg_driver.processor import EmgProcessor
from emg_driver.settings import Settings
from impedance_estimator.estimator import ESTIMATE_COLUMNS
from session_analysis.hold_measures import HoldMeasures
from session_analysis.recorded_session import RecordedSession
from session_recorder.bag_reader import BagReader

SHOWN_MARGIN = 30.0
"""[s] Time that is shown before the first and after the second hold."""
SMOOTHING = 0.1
"""[Hz] Cut-off frequency of the shown torque and EMG (the paper's figure 8 is low-pass filtered,
without a number)."""
TORQUE_RATE = 16.0
"""[Hz] Rate of the shown torque: torque is averaged over 1/16 s before it is smoothed; nothing
faster is shown."""


@dataclass(frozen=True)
class Excerpt:
    """Holds signals from shortly before one hold to shortly after the next.

    Attributes
    ----------
    first, second
        The holds.
    torque
        Time [s] and smoothed torque [N.m], shape (n, 2).
    estimates
        Rows of the session's estimates in that time, columns `ESTIMATE_COLUMNS`.
    responses
        Rows of the session's responses in that time.
    ensembles
        Ensemble averages of the two holds, each of shape (L, 5), columns of ``/emg/ensemble``.
    """

    first: HoldMeasures
    second: HoldMeasures
    torque: np.ndarray
    estimates: np.ndarray
    responses: np.ndarray
    ensembles: tuple[np.ndarray, np.ndarray]


def read_excerpt(
    session: RecordedSession,
    first: HoldMeasures,
    second: HoldMeasures,
    progress: Callable[[float], None] | None = None,
) -> Excerpt | None:
    """Read the signals; None where the bag holds neither EMG samples nor torque."""
    bag = BagReader(session.path)
    if not {SAMPLES_TOPIC, MOTION_TOPIC} <= set(bag.topics):
        return None
    start, end = first.hold.start - SHOWN_MARGIN, second.hold.end + SHOWN_MARGIN
    processors = [EmgProcessor(Settings(ensemble_size=1000)) for _ in range(2)]
    torque: list[tuple[float, float]] = []
    topics = [
        topic for topic in (REFERENCE_TOPIC, MOTION_TOPIC, SAMPLES_TOPIC) if topic in bag.topics
    ]
    for topic, _, message in bag.messages(topics, progress):
        block = unpack(message)
        if not len(block.time) or block.time[-1] < start or block.time[0] > end:
            continue
        if topic == MOTION_TOPIC:
            torque.append(
                (float(block.time.mean()), float(block.in_si()[0].column("torque[N.m]").mean()))
            )
        for processor, measures in zip(processors, (first, second), strict=True):
            if measures.hold.start - 2.0 <= block.time[0] <= measures.hold.end:
                feed(processor, topic, block)
    for processor in processors:
        processor.finish()
    estimates = session.estimates[
        (session.estimates[:, 0] >= start) & (session.estimates[:, 0] <= end)
    ]
    responses = session.responses[
        (session.responses[:, 0] >= start) & (session.responses[:, 0] <= end)
    ]
    return Excerpt(
        first,
        second,
        smoothed(np.array(torque)),
        estimates,
        responses,
        (processors[0].ensemble(), processors[1].ensemble()),
    )


def smoothed(series: np.ndarray) -> np.ndarray:
    """Put times [s] and values on an even grid, low-passed at `SMOOTHING`; shape (n, 2)."""
    series = series[np.isfinite(series).all(axis=1)]
    grid = np.arange(series[0, 0], series[-1, 0], 1.0 / TORQUE_RATE)
    sections = butter(2, SMOOTHING, fs=TORQUE_RATE, output="sos")
    return np.column_stack(
        [grid, sosfiltfilt(sections, np.interp(grid, series[:, 0], series[:, 1]))]
    )


def estimate_column(estimates: np.ndarray, name: str) -> np.ndarray:
    """Return one column of estimates by its full name, NaN where they are not valid; shape (n,)."""
    return np.where(
        estimates[:, ESTIMATE_COLUMNS.index("valid[1]")] > 0,
        estimates[:, ESTIMATE_COLUMNS.index(name)],
        np.nan,
    )
