"""From recorded sessions to the paper's Table III, its figures and a report."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

from emg_driver.muscles import BACKGROUND, MUSCLES, REFLEX
from impedance_estimator.algorithms import DEFAULT
from session_analysis.errors import AnalysisError
from session_analysis.estimate_origin import (
    NONE,
    NOT_STATED,
    SessionOrigin,
    changes_between_visits,
    in_force,
    origin_of_holds,
    require_one_estimator,
)
from session_analysis.excerpts import Excerpt, read_excerpt
from session_analysis.hold_measures import HoldMeasures, measure_hold
from session_analysis.hold_opinions import HoldOpinion, hold_opinions
from session_analysis.holds import Excluded, Hold
from session_analysis.known_of_session import NOTHING_GIVEN, GivenPhysics
from session_analysis.recorded_session import RecordedSession, read_session
from session_analysis.table3 import Cell, table3

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Validation:
    """Holds the result of validating sessions.

    Attributes
    ----------
    measures
        One for each hold that is used.
    excluded
        What was left out and why.
    cells
        Table III.
    notes
        What a reader should know, one sentence each.
    excerpt
        Signals about two holds, for figures 4 and 8; None where a bag has no samples.
    opinions
        Online and offline values of every complete hold, also of one that is left out.
    sessions
        How the numbers of each session were made, in the order of the bags.
    origin_notes
        Where model, rig or estimator differ from those of the recording or between the recordings
        of a subject, one sentence each; they are among the notes, too.
    """

    measures: list[HoldMeasures]
    excluded: list[Excluded]
    cells: list[Cell]
    notes: list[str]
    excerpt: Excerpt | None
    opinions: list[HoldOpinion] = field(default_factory=list)
    sessions: list[SessionOrigin] = field(default_factory=list)
    origin_notes: list[str] = field(default_factory=list)


def validate(
    bags: Sequence[Path],
    subjects: Sequence[str] = (),
    *,
    seed: int = 0,
    recompute: bool = False,
    progress: Progress | None = None,
    algorithm: str = DEFAULT,
    given: Sequence[GivenPhysics] = (),
) -> Validation:
    """Correlate impedance estimates with EMG over the holds of all sessions.

    Parameters
    ----------
    bags
        Recorded sessions; several of one subject count as one.
    subjects
        Whose each bag is; empty takes what the bags say.
    seed
        Seed of the bootstrap.
    recompute
        Estimates and responses from the samples, also where they were recorded.
    progress
        Called with what is done and the fraction.
    algorithm
        Of estimates that come from the samples.
    given
        Model and rig of estimates that come from the samples, one for each bag; empty takes those
        of the recordings.

    Raises
    ------
    BagError
        A bag that cannot be read, or lacks the samples that are needed.
    AnalysisError
        A bag without events, estimates of different origin, or no hold that can be used.
    """
    measures: list[HoldMeasures] = []
    excluded: list[Excluded] = []
    notes: list[str] = []
    sessions: list[RecordedSession] = []
    origins: list[SessionOrigin] = []
    used_origins: list[SessionOrigin] = []
    opinions: list[HoldOpinion] = []
    for number, bag in enumerate(bags):
        subject = subjects[number] if subjects else ""
        own = given[number] if given else NOTHING_GIVEN
        session = read_session(
            bag, subject, recompute, _named(progress, f"reading {bag}"), algorithm, own
        )
        sessions.append(session)
        notes += session.notes
        excluded += [
            Excluded(f"{session.subject}, {one.what}", one.reason) for one in session.excluded
        ]
        used = []
        for hold in session.holds:
            found, left_out = measure_hold(
                session.subject, hold, session.estimates, session.responses
            )
            excluded += left_out
            if found is not None:
                used.append(replace(found, bag=session.path))
        measures += used
        origins.append(_origin_of(session, [one.hold for one in used]))
        used_origins += origins[-1:] if used else []
    require_one_estimator(used_origins)
    origin_notes = [note for session in sessions for note in session.origin_notes]
    origin_notes += changes_between_visits(used_origins)
    for session in sessions:
        opinions += hold_opinions(session, _named(progress, f"second opinion on {session.path}"))
    if not measures:
        raise AnalysisError(_why_no_hold(excluded))
    if progress:
        progress("bootstrap", 0.0)
    cells = table3(measures, seed)
    excerpt = _excerpt(sessions, measures, _named(progress, "figures"))
    notes = [*origin_notes, *notes]
    return Validation(measures, excluded, cells, notes, excerpt, opinions, origins, origin_notes)


def _why_no_hold(excluded: Sequence[Excluded]) -> str:
    reasons = "; ".join(f"{one.what}: {one.reason}" for one in excluded[:3])
    return f"no hold can be used: {reasons or 'the recordings mark no hold'}"


def _excerpt(
    sessions: Sequence[RecordedSession],
    measures: list[HoldMeasures],
    progress: Callable[[float], None] | None,
) -> Excerpt | None:
    """Read the signals about the two neighbouring holds that differ most; None without two."""
    shown = _most_different_neighbours(measures)
    if shown is None:
        return None
    session = next(
        one for one in sessions if one.subject == shown[0].subject and shown[0].hold in one.holds
    )
    return read_excerpt(session, shown[0], shown[1], progress)


def _origin_of(session: RecordedSession, holds: Sequence[Hold]) -> SessionOrigin:
    """Return how the numbers of a session were made, of which these holds are used."""
    if holds:
        origin = origin_of_holds(session.origins, holds, session.path)
    else:
        origin = in_force(session.origins, math.inf)
    return SessionOrigin(session.path, session.subject, origin, session.made_anew, session.lag)


def write_table(validation: Validation, path: Path) -> None:
    """Write Table III as CSV: pathway, target, n, muscle, r and its interval."""
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["pathway", "torque_target[N.m]", "n", "muscle", "r", "ci_low", "ci_high"])
        for cell in validation.cells:
            found = cell.correlation
            writer.writerow(
                [
                    cell.pathway,
                    f"{cell.target:g}",
                    found.n,
                    cell.muscle,
                    *(f"{v:.4f}" for v in (found.r, found.low, found.high)),
                ]
            )


def write_holds(validation: Validation, path: Path) -> None:
    """Write every hold's paired data as CSV, in SI units, with what its estimates were made with.

    A field is empty where a number is not known.
    """
    origins = {one.path: one for one in validation.sessions}
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        counts = [f"responses_{muscle}" for muscle in MUSCLES]
        writer.writerow(
            [
                "subject",
                "hold",
                "torque_target[N.m]",
                "start[s]",
                "end[s]",
                "K[N.m/rad]",
                "G[N.m.s/rad]",
                *BACKGROUND,
                *REFLEX,
                *counts,
                "doubtful[1]",
                "recording",
                "algorithm",
                "model",
                "model_sha256",
                "rig",
                "rig_sha256",
                "plate_lag[s]",
            ]
        )
        for one in validation.measures:
            times = [f"{one.hold.start:.6f}", f"{one.hold.end:.6f}"]
            values = [f"{v:.6g}" for v in (one.K, one.G, *one.background, *one.reflex)]
            writer.writerow(
                [
                    one.subject,
                    one.hold.number,
                    f"{one.hold.target:g}",
                    *times,
                    *values,
                    *one.responses,
                    _number(one.doubtful),
                    one.bag.name,
                    *_origin_fields(origins.get(one.bag)),
                ]
            )


def _number(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else ""


def _origin_fields(session: SessionOrigin | None) -> list[str]:
    """Return algorithm, title and SHA-256 of model and of rig, and the plate's lag [s]."""
    if session is None or session.origin is None:
        return [NOT_STATED, *[NOT_STATED, ""] * 2, _number(session.lag if session else math.nan)]
    origin = session.origin
    return [
        origin.algorithm,
        *_title_and_sum(origin.model),
        *_title_and_sum(origin.rig),
        _number(session.lag),
    ]


def _title_and_sum(stated: Mapping[str, str] | None) -> list[str]:
    return [NONE, ""] if stated is None else [stated["title"], stated["sha256"]]


def _named(progress: Progress | None, what: str) -> Callable[[float], None] | None:
    return None if progress is None else lambda share: progress(what, share)


def _most_different_neighbours(
    measures: Sequence[HoldMeasures],
) -> tuple[HoldMeasures, HoldMeasures] | None:
    """Return two successive holds of a subject that differ most in K and G, relative to their
    size.
    """
    best, pair = -1.0, None
    for first, second in pairwise(measures):
        gap = second.hold.start - first.hold.end
        if first.subject != second.subject or not 0 <= gap < 120.0:
            continue
        difference = abs(second.K - first.K) / (second.K + first.K) + abs(second.G - first.G) / (
            second.G + first.G
        )
        if difference > best:
            best, pair = difference, (first, second)
    return pair
