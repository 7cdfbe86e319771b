"""Counts of verdicts with their 95 % intervals, as Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.stats import beta

from ankle_physics.term import term_library
from blind_rig.cases import MIN_STRENGTH_SHARE
from blind_rig.strength import STRENGTHS
from model_discrepancy.report.verdict import MIN_STATED_PROBABILITY
from simulation_study.verdict_cases import KINDS

# Bands of stated probability within which the share that is right is counted.
BANDS = (0.0, 0.3, 0.6, 0.8, 1.01)
# Strata in which false alarms are counted.
STRATA = ("servo", "protocol", "rate", "velocity", "reference", "noise", "variability")
Entry = dict[str, Any]


def rate_with_interval(hits: int, of: int) -> str:
    """Return a share with its 95 % interval (Clopper & Pearson 1934) in words.

    Parameters
    ----------
    hits, of
        Counts.
    """
    if of == 0:
        return "none"
    low = float(beta.ppf(0.025, hits, of - hits + 1)) if hits else 0.0
    high = float(beta.ppf(0.975, hits + 1, of - hits)) if hits < of else 1.0
    return f"{hits} of {of} ({100 * hits / of:.0f} %, {100 * low:.0f} to {100 * high:.0f} %)"


def family_of(name: str) -> str:
    """Return the family of a name; a name without one is its own.

    Parameters
    ----------
    name
        Of a term, a family or a finding.
    """
    terms = term_library()
    return terms[name].family or name if name in terms else name


def answers(entry: Entry) -> list[str]:
    """Return every name that is right in a case.

    Parameters
    ----------
    entry
        A case.
    """
    return [name for names in entry["right"] for name in names]


def stated_names(entry: Entry) -> list[tuple[str, float, bool]]:
    """Return names or families that a verdict states with confidence, their probability, and
    whether they are right.

    Parameters
    ----------
    entry
        A case.
    """
    right = answers(entry)
    of_families = {family_of(name) for name in right}
    found = []
    for effect in entry["effects"]:
        if effect["probability"] >= MIN_STATED_PROBABILITY:
            found.append((effect["name"], effect["probability"], effect["name"] in right))
        elif effect["family_probability"] >= MIN_STATED_PROBABILITY:
            found.append(
                (effect["family"], effect["family_probability"], effect["family"] in of_families)
            )
    return found


def is_moderate(entry: Entry) -> bool:
    """Say whether every hidden effect shows about as strongly as a moderate one is to.

    In some subjects and movements an effect cannot: within its range it looks like another
    stiffness, or like a reflex with another delay.

    Parameters
    ----------
    entry
        A case.
    """
    least = MIN_STRENGTH_SHARE * STRENGTHS["moderate"]
    return all(share >= least for share in entry.get("shares", {}).values())


def named(entry: Entry, exactly: bool) -> bool:
    """Say whether every hidden effect is among what the verdict names, stated or not.

    Parameters
    ----------
    entry
        A case with effects that the library holds.
    exactly
        The name itself, and not its family alone.
    """
    said = [e["name"] for e in entry["effects"]]
    if exactly:
        return all(any(name in said for name in names) for names in entry["right"])
    kin = {family_of(name) for name in said}
    return all(any(family_of(name) in kin for name in names) for names in entry["right"])


def score(entry: Entry, key: str) -> tuple[float, float] | None:
    """Return relative error and standard score of K or G; None without truth or estimate.

    Parameters
    ----------
    entry
        A case.
    key
        Name with unit.
    """
    estimate = (entry.get("parameters") or {}).get(key)
    if "truth" not in entry or not estimate or not estimate["standard_error"]:
        return None
    error = estimate["augmented"] - entry["truth"][key]
    return error / entry["truth"][key], error / estimate["standard_error"]


def table(
    entries: list[Entry], shown: Mapping[str, Sequence[str]] | None = None
) -> list[tuple[str, str]]:
    """Return every count with its interval.

    Parameters
    ----------
    entries
        Cases.
    shown
        Names that each human trial shows without anything planted, by its name.
    """
    of = {kind: [e for e in entries if e["plan"]["kind"] == kind] for kind in KINDS}
    lines = [("false alarms", _share(e["verdict"] != "no_mismatch" for e in of["null"]))]
    for stratum in STRATA:
        for value in sorted({e["plan"][stratum] for e in of["null"]}, key=str):
            own = [e for e in of["null"] if e["plan"][stratum] == value]
            count = _share(e["verdict"] != "no_mismatch" for e in own)
            lines.append((f"false alarms, {stratum} {value}", count))
    wrong = f"stated with {MIN_STATED_PROBABILITY:g} or more and wrong"
    for kind, words in (
        ("effect", f"{wrong}, one effect"),
        ("pair", f"{wrong}, two effects"),
        ("planted", f"{wrong}, planted in human trials"),
        ("planted_from_rig", f"{wrong}, planted in human trials by the rig's equations"),
    ):
        lines.append(
            (words, _share(not right for e in of[kind] for _, _, right in stated_names(e)))
        )
    # No name is right there, so that the share is one of recordings.
    for kind, words in (("left_out", "family left out"), ("foreign", "foreign to the library")):
        count = _share(bool(stated_names(e)) for e in of[kind])
        lines.append((f"{words}: a name is stated with {MIN_STATED_PROBABILITY:g} or more", count))
    weaker = [e for e in entries if not is_moderate(e)]
    of = {kind: [e for e in own if is_moderate(e)] for kind, own in of.items()}
    for kind, words in (
        ("effect", "one effect"),
        ("planted", "planted in human trials"),
        ("planted_from_rig", "planted in human trials by the rig's equations"),
    ):
        lines += [
            (f"{words}: named exactly", _share(named(e, True) for e in of[kind])),
            (f"{words}: its family named", _share(named(e, False) for e in of[kind])),
            (f"{words}: overlooked", _share(e["verdict"] == "no_mismatch" for e in of[kind])),
        ]
    lines += _beside_own(of, shown or {})
    lines += [
        ("two effects: both families named", _share(named(e, False) for e in of["pair"])),
        (
            "foreign or left out: unexplained",
            _share(e["verdict"] == "unexplained" for e in of["foreign"] + of["left_out"]),
        ),
        (
            "hidden, but less than moderate in this subject and movement, not counted above: "
            "a mismatch was seen",
            _share(e["verdict"] != "no_mismatch" for e in weaker),
        ),
        (
            "good recordings called bad",
            _share(e["verdict"] == "bad_recording" for e in entries),
        ),
    ]
    return [*lines, *reliability(entries), *_impedance(entries)]


def _beside_own(
    of: Mapping[str, list[Entry]], shown: Mapping[str, Sequence[str]]
) -> list[tuple[str, str]]:
    """Return the counts of what is planted in human trials, where the trial does not show it
    itself.
    """
    lines = []
    for kind, words in (
        ("planted", "planted in human trials and not shown by the trial itself"),
        ("planted_from_rig", "the same by the rig's equations"),
    ):
        for exactly, what in ((True, "named exactly"), (False, "its family named")):
            fresh = [
                e
                for e in of[kind]
                if e["plan"]["protocol"] in shown
                and not named(_naming(e, shown[e["plan"]["protocol"]]), exactly)
            ]
            lines.append((f"{words}: {what}", _share(named(e, exactly) for e in fresh)))
    return lines


def _naming(entry: Entry, names: Sequence[str]) -> Entry:
    """Return a case as if its verdict had these names."""
    return entry | {"effects": [{"name": name} for name in names]}


def reliability(entries: list[Entry]) -> list[tuple[str, str]]:
    """Return how many names and families are right in each band of their stated probability.

    Parameters
    ----------
    entries
        Cases; recordings without mismatch count as well, every name there is wrong.
    """
    names, kin = [], []
    for entry in entries:
        right = answers(entry)
        of_families = {family_of(name) for name in right}
        for e in entry["effects"]:
            names.append((e["probability"], e["name"] in right))
            kin.append((e["family_probability"], e["family"] in of_families))
    lines = []
    for words, stated in (("names", names), ("families", kin)):
        for low, high in pairwise(BANDS):
            own = [(p, hit) for p, hit in stated if low <= p < high]
            if own:
                mean = float(np.mean([p for p, _ in own]))
                count = _share(hit for _, hit in own)
                lines.append((f"{words} stated with {mean:.2f} on average: right", count))
    return lines


def _share(hits: Iterable[bool]) -> str:
    counted = list(hits)
    return rate_with_interval(sum(counted), len(counted))


def _impedance(entries: list[Entry]) -> list[tuple[str, str]]:
    lines = []
    for key, symbol in (("K[N.m/rad]", "K"), ("G[N.m.s/rad]", "G")):
        for words, kinds in (("without mismatch", ("null",)), ("one effect", ("effect",))):
            own = [e for e in entries if e["plan"]["kind"] in kinds]
            scores = [s for e in own if (s := score(e, key))]
            middle = 100 * float(np.median([abs(r) for r, _ in scores])) if scores else math.nan
            lines += [
                (f"{symbol}, {words}: median error", f"{middle:.1f} %"),
                (
                    f"{symbol}, {words}: within two standard errors",
                    _share(abs(z) <= 2.0 for _, z in scores),
                ),
            ]
    seconds = float(np.median([e["seconds"] for e in entries])) if entries else math.nan
    return [*lines, ("processor time of a diagnosis, median", f"{seconds:.0f} s")]


def _hidden(entry: Entry) -> str:
    """Return what a case hides, each effect with the share of the torque's variance that it adds
    beyond what the paper's model could imitate.
    """
    shares = entry.get("shares", {})
    words = [
        f"{name} ({100 * shares[name]:.1f} %)" if name in shares else name
        for name in entry["plan"]["hidden"]
    ]
    return " and ".join(words) or "nothing"


def report(
    entries: list[Entry], command: str, shown: Mapping[str, Sequence[str]] | None = None
) -> str:
    """Return the counts and every case.

    Parameters
    ----------
    entries
        Cases.
    command
        With which they are made again.
    shown
        As `table` takes it.
    """
    lines = [
        "# Verdicts counted",
        "",
        f"`{command} --out FOLDER`",
        "",
        "| | counted (95 % interval) |",
        "| --- | --- |",
        *(f"| {name} | {value} |" for name, value in table(entries, shown)),
        "",
        "| case (share of the torque's variance) | servo | protocol | rate | velocity | verdict "
        "| named (probability; family) |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for entry in entries:
        plan = entry["plan"]
        said = ", ".join(
            f"{e['name']} ({e['probability']:.2f}; {e['family']} {e['family_probability']:.2f})"
            for e in entry["effects"]
        )
        lines.append(
            f"| {plan['kind']}: {_hidden(entry)} | {plan['servo']} | "
            f"{plan['protocol']} | {plan['rate']:g} | {'yes' if plan['velocity'] else 'no'} | "
            f"{entry['verdict']} | {said} |"
        )
    return "\n".join(lines) + "\n"
