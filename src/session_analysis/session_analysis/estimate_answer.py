"""What a recording's estimates say: values with errors, how much of it is valid, what is in doubt,
and why nothing is valid where nothing is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ankle_interfaces.saturation import saturation_sentences
from ankle_interfaces.topics import ANKLE_SAMPLES, PERTURBATION_REFERENCE
from impedance_estimator.estimator import ESTIMATE_COLUMNS
from impedance_estimator.judgements import (
    ShareOfTime,
    shares_of_doubted_time,
    shares_of_invalid_time,
)
from impedance_estimator.offline.recorded_estimates import OfflineResult
from impedance_estimator.reference_track import LONGEST_WAIT
from impedance_estimator.simultaneous.doubt import DOUBT_THRESHOLD
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.recording.recording import Recording
from session_analysis.errors import AnalysisError
from session_analysis.second_opinion import (
    MIN_MOVEMENT,
    SecondOpinion,
    movements,
    second_opinion,
)
from session_recorder.bag_reader import BagReader
from session_recorder.importing.sampling import judge_times
from session_recorder.loss import LossAccount, account_of_bag

QUANTITIES = ("K[N.m/rad]", "B[N.m.s/rad]", "I[kg.m^2]", "G[N.m.s/rad]")
MIN_RECORDING = 11.0
"""[s] Shortest recording that gives estimates: the first valid one comes about 10.5 s after the
start, when the estimators have settled for 10 s; this is the next whole second."""
START_TIME = LONGEST_WAIT + 1.0
"""[s] Shorter recordings may have no estimate at all, not even one that is not valid: samples wait
for their reference, then the sampling rate is found within a second."""


@dataclass(frozen=True)
class Answer:
    """Holds the result of estimating one recording.

    Attributes
    ----------
    bag
        The recording.
    algorithm
        Of the estimates.
    settings
        Of the estimator, as text.
    rows
        Estimates, shape (n, m), columns `ESTIMATE_COLUMNS`.
    torques
        Shape (j, 4), columns `TORQUE_COLUMNS`.
    losses
        What the recording lacks.
    notes
        What happened on the way, one sentence each.
    opinion
        Offline second opinion; None where it is impossible, `no_opinion` then says why.
    no_opinion
        Why there is no second opinion; empty where there is one.
    not_valid
        Why estimates are not valid, and how long.
    doubts
        Why valid estimates are doubtful, and how long.
    saturated
        Which channels stand at an end of their range, and what to do, one sentence each.
    """

    bag: Path
    algorithm: str
    settings: str
    rows: np.ndarray
    torques: np.ndarray
    losses: LossAccount
    notes: list[str]
    opinion: SecondOpinion | None
    no_opinion: str
    not_valid: list[ShareOfTime]
    doubts: list[ShareOfTime]
    saturated: list[str]

    def column(self, name: str) -> np.ndarray:
        """Return one column of the estimates, shape (n,)."""
        return self.rows[:, ESTIMATE_COLUMNS.index(name)]

    @property
    def valid(self) -> np.ndarray:
        """Tell whether each estimate is valid, shape (n,)."""
        return self.column("valid[1]") > 0

    @property
    def doubtful(self) -> np.ndarray:
        """Tell whether each estimate is valid but doubtful, shape (n,).

        None is doubtful where the estimator states no doubt.
        """
        if "doubt[1]" not in ESTIMATE_COLUMNS:
            return np.zeros(len(self.rows), dtype=bool)
        return self.valid & (self.column("doubt[1]") >= DOUBT_THRESHOLD)

    def remarks(self) -> list[str]:
        """Return what a reader of the values must know beside them, one sentence each."""
        absent = [f"no second opinion: {self.no_opinion}"] if self.opinion is None else []
        return [*self.notes, *absent]

    def median(self, quantity: str, half: int | None = None) -> tuple[float, float]:
        """Return the median over the valid estimates, and the median of their standard errors.

        Parameters
        ----------
        quantity
            Name with its unit, such as ``K[N.m/rad]``.
        half
            0 or 1 for a half of the recording, None for all of it.

        Returns
        -------
        tuple[float, float]
            NaN where no estimate is valid.
        """
        good = self.valid
        if half is not None and len(good):
            time = self.column("t[s]")
            good = good & ((time >= np.median(time)) == bool(half))
        if not good.any():
            return float("nan"), float("nan")
        error = self.column(f"se_{quantity}")[good]
        known = error[np.isfinite(error)]
        return (
            float(np.median(self.column(quantity)[good])),
            float(np.median(known)) if len(known) else float("nan"),
        )


def answer(
    bag: Path,
    result: OfflineResult,
    algorithm: str,
    settings: str,
    progress: Callable[[str, float], None] | None = None,
) -> Answer:
    """Gather everything that a report of a recording's estimates says.

    Parameters
    ----------
    bag
        The recording.
    result
        Estimates of the recording.
    algorithm, settings
        Algorithm and settings of the estimates.
    progress
        Called with what is done and the fraction.

    Raises
    ------
    BagError
        The bag cannot be read.
    """
    if progress:
        progress("counting losses", 0.0)
    losses = account_of_bag(BagReader(bag))
    if progress:
        progress("second opinion", 0.5)
    opinion, reason, saturated, notes = None, "", list[str](), list(result.notes)
    try:
        recording = Recording.from_bag(bag)
        saturated = saturation_sentences(recording.channels(), recording.reference)
        stretch = recording.longest_stretch()
        if stretch.duration < MIN_RECORDING:
            stretch = recording
        if stretch is not recording:
            first = stretch.start - recording.start
            notes.append(
                f"{recording.faults[0]}: the second opinion and its halves are of the longest "
                f"stretch without one, {first:.1f} to {first + stretch.duration:.1f} s"
            )
        if stretch.faults:
            reason = "; ".join(stretch.faults)
        else:
            opinion = second_opinion(stretch)
    except (DiagnosisError, ValueError) as error:
        reason = str(error)
    if progress:
        progress("second opinion", 1.0)
    if PERTURBATION_REFERENCE.absolute not in BagReader(bag).topics:
        notes.append(
            "the recording has no commanded angle: without it torque that moves a rig that gives "
            "way cannot be told from the ankle's answer, errors are larger and more is doubted. "
            "Import the commanded angle as reference_position if the rig can record it"
        )
    return Answer(
        bag,
        algorithm,
        settings,
        result.rows,
        result.torques,
        losses,
        notes,
        opinion,
        reason,
        shares_of_invalid_time(result.judgements),
        shares_of_doubted_time(result.judgements),
        saturated,
    )


def why_nothing_is_valid(bag: Path) -> str:
    """Return why a recording gives no valid estimate, and what to do, in one sentence each.

    Parameters
    ----------
    bag
        A recording with the topic ``/ankle/samples``.

    Raises
    ------
    BagError
        The bag cannot be read, or has no such samples.
    """
    columns, data = BagReader(bag).signal(ANKLE_SAMPLES.absolute)
    time = data[:, 0][np.isfinite(data[:, 0])]
    if len(time) < 2:
        return f"the recording holds {len(time)} sample(s); record at least {MIN_RECORDING:g} s"
    reasons = []
    duration = float(time[-1] - time[0])
    if duration < MIN_RECORDING:
        reasons.append(
            f"the recording lasts {duration:.1f} s; the first valid estimate comes up to "
            f"{MIN_RECORDING:g} s after the start: record longer"
        )
    try:
        sampling = judge_times(time)
    except ValueError as error:
        return f"{error}; import the recording again with --rate"
    if sampling.kind == "irregular":
        reasons.append(
            f"{sampling.sentence}; import the recording again with --resample {sampling.rate:.6g}"
        )
    for quantity in ("position", "torque"):
        values = [data[:, k] for k, name in enumerate(columns) if name.startswith(f"{quantity}[")]
        if not values:
            continue
        share = float(np.mean(~np.isfinite(values[0])))
        if share > 0.1:
            reasons.append(f"{100 * share:.0f} % of the samples of {quantity} are NaN or infinite")
        elif quantity == "position" and _movement(values[0], sampling.rate) < MIN_MOVEMENT:
            reasons.append(
                f"the position moves by {_movement(values[0], sampling.rate):.2g} rad (standard "
                "deviation within a second): no perturbation to learn from. Record while the "
                "perturbation runs"
            )
        elif np.nanstd(values[0]) == 0:
            reasons.append(f"the {quantity} does not change: is its sensor connected?")
    return "; ".join(reasons) or (
        "position and torque do not go together as an ankle's do; check columns, units and sign, "
        "or see 'ankle diagnose'"
    )


def _movement(values: np.ndarray, rate: float) -> float:
    """Return the typical movement [rad] within a second."""
    return float(np.median(movements(values, rate)))


def require_start(bag: Path) -> None:
    """Refuse a recording that ends before an estimator begins.

    Parameters
    ----------
    bag
        With the ankle's samples.

    Raises
    ------
    AnalysisError
        It does; the message says what to do.
    BagError
        The bag cannot be read, or has no such samples.
    """
    time = BagReader(bag).signal(ANKLE_SAMPLES.absolute)[1][:, 0]
    time = time[np.isfinite(time)]
    if len(time) < 2 or np.ptp(time) < START_TIME:
        raise AnalysisError(f"{bag}: no estimate: {why_nothing_is_valid(bag)}")


def require_valid(found: Answer) -> None:
    """Refuse a recording without a valid estimate.

    Raises
    ------
    AnalysisError
        None is valid; the message says why and what to do.
    """
    if not found.valid.any():
        raise AnalysisError(
            f"{found.bag}: none of {len(found.rows)} estimates is valid: "
            f"{why_nothing_is_valid(found.bag)}"
        )
