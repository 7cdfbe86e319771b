"""From recorded sessions to the paper's Table III, its figures and a report."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

from ankle_interfaces.yaml_text import YamlError, parse_yaml
from emg_driver.muscles import BACKGROUND, MUSCLES, REFLEX
from impedance_estimator.algorithms import DEFAULT
from session_analysis.errors import AnalysisError
from session_analysis.excerpts import Excerpt, read_excerpt
from session_analysis.hold_measures import HoldMeasures, measure_hold
from session_analysis.hold_opinions import HoldOpinion, hold_opinions
from session_analysis.holds import Excluded
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
    """

    measures: list[HoldMeasures]
    excluded: list[Excluded]
    cells: list[Cell]
    notes: list[str]
    excerpt: Excerpt | None
    opinions: list[HoldOpinion] = field(default_factory=list)


def validate(
    bags: Sequence[Path],
    subjects: Sequence[str] = (),
    *,
    seed: int = 0,
    recompute: bool = False,
    progress: Progress | None = None,
    algorithm: str = DEFAULT,
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

    Raises
    ------
    BagError
        A bag that cannot be read, or lacks the samples that are needed.
    AnalysisError
        A bag without events, or no hold that can be used.
    """
    measures: list[HoldMeasures] = []
    excluded: list[Excluded] = []
    notes: list[str] = []
    sessions: list[RecordedSession] = []
    opinions: list[HoldOpinion] = []
    for number, bag in enumerate(bags):
        subject = subjects[number] if subjects else ""
        session = read_session(
            bag, subject, recompute, _named(progress, f"reading {bag}"), algorithm
        )
        sessions.append(session)
        notes += session.notes
        excluded += [
            Excluded(f"{session.subject}, {one.what}", one.reason) for one in session.excluded
        ]
        for hold in session.holds:
            found, left_out = measure_hold(
                session.subject, hold, session.estimates, session.responses
            )
            excluded += left_out
            if found is not None:
                measures.append(found)
    _require_one_origin(sessions)
    for session in sessions:
        opinions += hold_opinions(session, _named(progress, f"second opinion on {session.path}"))
    if not measures:
        raise AnalysisError(_why_no_hold(excluded))
    if progress:
        progress("bootstrap", 0.0)
    cells = table3(measures, seed)
    excerpt = _excerpt(sessions, measures, _named(progress, "figures"))
    return Validation(measures, excluded, cells, notes, excerpt, opinions)


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


def _require_one_origin(sessions: Sequence[RecordedSession]) -> None:
    """Refuse estimates that were not all made with one estimator, its settings, model and rig.

    Model and rig may differ between subjects, whose own they are, and not within one.
    """
    first: dict[tuple[str, str], tuple[str, Path]] = {}
    for session in sessions:
        for line in session.provenances:
            stated = _stated(line, session.path)
            for key in ("algorithm", "settings", "model", "rig"):
                whose = "" if key in ("algorithm", "settings") else session.subject
                value = yaml.safe_dump(stated[key], default_flow_style=True).splitlines()[0]
                known, path = first.setdefault((whose, key), (value, session.path))
                if value != known:
                    raise AnalysisError(
                        f"estimates of different origin are not mixed: {key} is {known} in {path} "
                        f"and {value} in {session.path}; --recompute makes all of them anew"
                    )


def _stated(provenance: str, path: Path) -> dict[str, Any]:
    """Return what the estimates of a bag were made with, by its key."""
    try:
        stated = parse_yaml(provenance)
    except YamlError as error:
        raise AnalysisError(f"{path}: the origin of its estimates is {error}") from None
    if not isinstance(stated, dict):
        raise AnalysisError(f"{path}: the origin of its estimates is no table: {provenance!r}")
    return stated


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
    """Write every hold's paired data as CSV, in SI units."""
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
                ]
            )


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
