"""Counts of verdicts on recordings of `second_rig` with their 95 % intervals, as Markdown."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from model_discrepancy.report.verdict import MIN_STATED_PROBABILITY
from simulation_study.verdict_report import (
    named,
    rate_with_interval,
    reliability,
    score,
    stated_names,
)

KINDS = {
    "base": "without a mismatch",
    "effect": "one effect",
    "pair": "two effects",
    "unlisted": "physics that nobody lists",
}
"""Kinds of recordings in words."""
QUANTITIES = {"K": "K[N.m/rad]", "G": "G[N.m.s/rad]"}
# Within so many standard errors an estimate counts as covered: 95 % of the normal distribution.
COVERED = 2.0
Entry = dict[str, Any]


def in_sets(entry: Entry) -> bool:
    """Say whether a right name of every hidden effect is in a set that the verdict leaves open, or
    is named.

    Parameters
    ----------
    entry
        A recording with effects that the library holds.
    """
    said = {name for e in entry["effects"] for name in (e["name"], *(e["set"] or ()))}
    return all(said & set(names) for names in entry["right"])


def is_right_about_unlisted(entry: Entry) -> bool:
    """Say whether a verdict claims no wrong physics: it is unexplained, or states no wrong name.

    Parameters
    ----------
    entry
        A recording that hides what nobody lists.
    """
    return entry["verdict"] == "unexplained" or all(right for *_, right in stated_names(entry))


def counts(entries: list[Entry]) -> list[tuple[str, str]]:
    """Return every count with its interval.

    Parameters
    ----------
    entries
        Recordings, from `second_rig_study.counted`.
    """
    of = {kind: [e for e in entries if e["kind"] == kind] for kind in KINDS}
    lines = [("false alarms", _share(e["verdict"] != "no_mismatch" for e in of["base"]))]
    for kind, exact, family, in_set in (
        ("effect", "named exactly", "its family named", "named or in an open set"),
        ("pair", "both named exactly", "both families named", "both named or in open sets"),
    ):
        words, own = KINDS[kind], [e for e in of[kind] if e["right"]]
        lines += [
            (f"{words}: {exact}", _share(named(e, True) for e in own)),
            (f"{words}: {family}", _share(named(e, False) for e in own)),
            (f"{words}: {in_set}", _share(in_sets(e) for e in own)),
            (f"{words}: overlooked", _share(e["verdict"] == "no_mismatch" for e in of[kind])),
        ]
    lines.append(
        (
            f"{KINDS['unlisted']}: unexplained, or no wrong name is stated",
            _share(is_right_about_unlisted(e) for e in of["unlisted"]),
        )
    )
    stated = [right for e in entries for *_, right in stated_names(e)]
    lines.append(
        (
            f"names and families stated with {MIN_STATED_PROBABILITY:g} or more: wrong",
            _share(not right for right in stated),
        )
    )
    lines.append(
        ("good recordings called bad", _share(e["verdict"] == "bad_recording" for e in entries))
    )
    return [*lines, *reliability(entries), *_impedance(of)]


def _share(hits: Iterable[bool]) -> str:
    counted = list(hits)
    return rate_with_interval(sum(counted), len(counted))


def _impedance(of: dict[str, list[Entry]]) -> list[tuple[str, str]]:
    """Return errors of K and G, of the base model and with what was found, by kind."""
    lines = []
    for symbol, key in QUANTITIES.items():
        for kind, words in KINDS.items():
            errors = [_errors(e, key) for e in of[kind]]
            scores = [s for e in of[kind] if (s := score(e, key))]
            found = [100.0 * abs(pair[1]) for pair in errors if pair]
            plain = [100.0 * abs(pair[0]) for pair in errors if pair]
            middle = f"{np.median(found):.1f} %, {np.median(plain):.1f} %" if found else "none"
            within = _share(abs(z) <= COVERED for _, z in scores)
            lines += [
                (f"{symbol}, {words}: median error, that of the base model", middle),
                (f"{symbol}, {words}: within two standard errors", within),
            ]
    return lines


def _errors(entry: Entry, key: str) -> tuple[float, float] | None:
    """Return the relative errors of the base model and with what was found."""
    estimate, truth = entry["parameters"].get(key), entry["truth"][key]
    if not estimate:
        return None
    return estimate["base"] / truth - 1.0, estimate["augmented"] / truth - 1.0


def report(entries: list[Entry], command: str) -> str:
    """Return the counts and every recording.

    Parameters
    ----------
    entries
        Recordings.
    command
        With which they are made again.
    """
    ordered = sorted(entries, key=lambda e: (list(KINDS).index(e["kind"]), e["case"]))
    lines = [
        "# Verdicts on a third engine",
        "",
        f"`{command} --out FOLDER`: {len(entries)} recordings of `second_rig`. An effect that the "
        "library lacks cannot be named; G is the torque impulse for each radian of stretch.",
        "",
        "| | counted (95 % interval) |",
        "| --- | --- |",
        *(f"| {name} | {value} |" for name, value in counts(entries)),
        "",
        "| hidden (share of the torque's variance) | protocol | servo [N.m/rad] | verdict | "
        "named (probability; family) | right names | K: truth, base model, found | G |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
        *(_row(entry) for entry in ordered),
    ]
    return "\n".join(lines) + "\n"


def _row(entry: Entry) -> str:
    hidden = [f"{name} ({100.0 * part:.1f} %)" for name, part in entry["shares"].items()]
    said = [
        f"{e['name']} ({e['probability']:.2f}; {e['family']} {e['family_probability']:.2f})"
        for e in entry["effects"]
    ]
    right = ["/".join(names) for names in entry["right"]]
    servo = entry["servo"]
    cells = (
        " and ".join(hidden) or "nothing",
        entry["protocol"],
        "rigid" if servo is None else f"{servo:.0f}",
        entry["verdict"],
        ", ".join(said) or "nothing",
        " and ".join(right) or "none",
        *(_values(entry, key) for key in QUANTITIES.values()),
    )
    return f"| {' | '.join(cells)} |"


def _values(entry: Entry, key: str) -> str:
    """Return truth, base model and what was found with its standard error, in words."""
    truth, estimate = f"{entry['truth'][key]:.3g}", entry["parameters"].get(key)
    if not estimate:
        return f"{truth}, -, -"
    error = estimate["standard_error"]
    around = "" if error is None else f" ± {error:.2g}"
    return f"{truth}, {estimate['base']:.3g}, {estimate['augmented']:.3g}{around}"
