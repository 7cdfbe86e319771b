"""What a report says about the effects that were named."""

from __future__ import annotations

import math
import sys
from html import escape
from inspect import getdoc
from typing import Any

from ankle_interfaces.value_text import readable_unit, three_digits, with_error, with_unit
from ankle_physics.term import term_library
from model_discrepancy.report.page import html_table
from model_discrepancy.report.plain_words import in_words, words
from model_discrepancy.report.verdict import MIN_STATED_PROBABILITY

# Names in the headline; the sections below hold all of them.
NAMES_IN_HEADLINE = 3
# A name that is more likely wrong than right is a candidate, and not in the headline.
LIKELY = 0.5


def likely_names(effects: list[dict[str, Any]]) -> str:
    """Return the first few names that are likelier right than wrong, with their probabilities, and
    how many more there are; where none is, the likeliest one.

    Parameters
    ----------
    effects
        Of a verdict; at least one.
    """
    likely = [effect for effect in effects if _stated_probability(effect) >= LIKELY]
    named = likely[:NAMES_IN_HEADLINE] or [max(effects, key=_stated_probability)]
    more, weaker = len(likely[NAMES_IN_HEADLINE:]), len(effects) - max(len(likely), 1)
    said = [stated_name(effect) for effect in named]
    said += [f"{more} more below"] if more else []
    if weaker:
        said.append(f"{weaker} less likely {'one' if weaker == 1 else 'ones'} below")
    return "; ".join(said)


def stated_name(effect: dict[str, Any]) -> str:
    """Return the name, or the family and its likeliest member where the members could not be told
    apart, with its probability.

    Parameters
    ----------
    effect
        Of a verdict.
    """
    name, stated = words(effect["name"]), words(effect["stated"])
    about = f"probability {_stated_probability(effect):.2f}"
    return f"{name} ({about})" if stated == name else f"{stated} such as {name} ({about})"


def is_stated(effects: list[dict[str, Any]]) -> bool:
    """Tell whether one of the effects is probable enough to be stated.

    Parameters
    ----------
    effects
        Of a verdict.
    """
    return any(_stated_probability(effect) >= MIN_STATED_PROBABILITY for effect in effects)


def effect_sections(effects: list[dict[str, Any]]) -> list[str]:
    """Return what was left out: each effect with what it does, its numbers and what they mean, and
    what the effects do to K and G.

    Parameters
    ----------
    effects
        Of a verdict.
    """
    parts = ["<h2>What was left out</h2>"]
    for effect in effects:
        parts += [
            f"<h3>{escape(words(effect['name']).capitalize())}</h3>",
            f"<p>{escape(_about(effect))}</p>",
            _numbers(effect),
        ]
    return parts + _consequences(effects)


def equations(effects: list[dict[str, Any]]) -> list[str]:
    """Return equation and source of each term that is named, as its file states them: in the first
    lines of the file and of its class.

    Parameters
    ----------
    effects
        Of a verdict.
    """
    rows = []
    for effect in effects:
        term = term_library().get(effect["name"])
        if term is not None:
            equation = (getdoc(sys.modules[term.__module__]) or "").rstrip(". \n")
            text = f"{equation}. {getdoc(term) or ''}".replace("``", "").replace("`", "")
            rows.append([words(effect["name"]), in_words(" ".join(text.split()))])
    head = ["term", "equation, what it models, and source"]
    return ["<h2>Equations and sources</h2>", html_table(head, rows)] if rows else []


def exclusions(effects: list[dict[str, Any]]) -> list[str]:
    """Return what would not do instead of each effect, and why.

    Parameters
    ----------
    effects
        Of a verdict.
    """
    rows = [
        [words(effect["name"]), words(other), why]
        for effect in effects
        for other, why in effect.get("excluded", {}).items()
    ]
    head = ["instead of", "excluded", "because"]
    return ["<h2>What was excluded, and by what</h2>", html_table(head, rows)] if rows else []


def _stated_probability(effect: dict[str, Any]) -> float:
    """Return the probability of what is stated: of the name, or of its family."""
    by_name = effect["stated"] == effect["name"]
    return float(effect["probability" if by_name else "family_probability"])


def _about(effect: dict[str, Any]) -> str:
    """Return what an effect is and does, how sure it is, and what was not excluded."""
    rivals = [words(name) for name in effect["set"][1:]]
    said = "Stated" if is_stated([effect]) else "Likeliest"
    doubt = f" Not excluded: {', '.join(rivals)}." if rivals else ""
    open_end = (
        " Something else is missing, too, which may change it." if effect["tentative"] else ""
    )
    return (
        f"{effect['sentence']} It is a property of the {effect['belongs_to']} "
        f"({effect['location']}). {said}: {stated_name(effect)}.{doubt}{open_end}"
    )


def _numbers(effect: dict[str, Any]) -> str:
    """Return the values of an effect's parameters with their errors, and what they mean."""
    term = term_library().get(effect["name"])
    meanings = {p.key: p.description for p in term.parameters} if term is not None else {}
    rows = []
    for key, (value, error) in effect["parameters"].items():
        symbol, _, unit = key.removesuffix("]").partition("[")
        # The fit states no error where a value ends at a bound.
        text = with_error((value, math.nan if error is None else error))
        unit = readable_unit(unit).replace("^3", "³")
        end = "" if error is not None else " It has no error, as at the end of its range."
        rows.append([symbol, f"{text} {unit}".strip(), meanings.get(key, "") + end])
    return html_table(["", "value ± standard error", ""], rows) if rows else ""


def _consequences(effects: list[dict[str, Any]]) -> list[str]:
    """Return what each effect does to K and G, as a table."""
    acting = [effect for effect in effects if effect.get("on_impedance")]
    if not acting:
        return []
    whole = acting[0]["on_impedance"]
    rows = [
        [f"without {words(e['name'])}", *(three_digits(e["on_impedance"][q][0]) for q in whole)]
        for e in acting
    ]
    with_all = [
        with_error((value, math.nan if error is None else error))
        for _, value, error in whole.values()
    ]
    head = ["model", *(with_unit(quantity) for quantity in whole)]
    return [
        "<h2>What it does to stiffness and reflex gain</h2>",
        html_table(head, [["with all that was found", *with_all], *rows]),
    ]
