"""The verdict is drawn here: no mismatch, explained, unexplained or a bad recording."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from ankle_physics.joint_profile import joint_in_force
from ankle_physics.term import term_library
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.recording.channel_gains import Finding
from model_discrepancy.report.effect_size import Size, sentence_of
from model_discrepancy.search.exchange import ODDS_SCALE
from model_discrepancy.search.found import Effect, Found

# The best names of a set; further ones stand among the alternatives.
LARGEST_SET = 3


class Standing(Enum):
    """Says what the data hold against a model."""

    COMPLETE = "nothing"
    CRITICISED = "something too small to matter is predictable, or corrects its shape"
    INCOMPLETE = "something that matters is still predictable"
    UNEXPLAINED = "most of what is predictable"


# How sure a name and its family are at most: of the first effect, and of further ones, which may
# only correct the shape of what is missing. These are the shares that were right among the names
# of 210 recordings, hidden effects of the library and effects that it lacks mixed (Laplace's rule):
# 55 of 58, 29 of 44, 18 of 31 and 12 of 46 first names, 18 of 22, 20 of 29, 7 of 40 and 9 of 73
# further ones. A relative of a term that the library lacks looks like the term, so that no single
# recording makes a name certain. Families of criticised models (33 of 44 and 22 of 29) are not
# stated as sure, whatever their share, and no further name as surer than a first one. Of the
# further names of models with nothing against them, all 24 were right in three later studies of
# 680 recordings: 0.88 is the lower end of the one-sided 95 % interval.
CERTAINTY = {
    (True, Standing.COMPLETE): (0.93, 0.93),
    (True, Standing.CRITICISED): (0.65, 0.69),
    (True, Standing.INCOMPLETE): (0.58, 0.64),
    (True, Standing.UNEXPLAINED): (0.27, 0.31),
    (False, Standing.COMPLETE): (0.88, 0.88),
    (False, Standing.CRITICISED): (0.65, 0.69),
    (False, Standing.INCOMPLETE): (0.19, 0.21),
    (False, Standing.UNEXPLAINED): (0.13, 0.17),
}
# From here on a name is stated; below, its family is where that is surer.
MIN_STATED_PROBABILITY = 0.7


@dataclass
class Verdict:
    """Holds what `diagnose` concludes; `content` is what ``verdict.json`` holds.

    The page docs/missing_physics.md describes that file.
    """

    verdict: str
    effects: list[dict[str, Any]] = field(default_factory=list)
    localisation: dict[str, Any] = field(default_factory=dict)
    fit: dict[str, Any] = field(default_factory=dict)
    alternatives: list[dict[str, Any]] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)
    recording: dict[str, Any] = field(default_factory=dict)
    variability: dict[str, Any] = field(default_factory=dict)
    rig: dict[str, Any] = field(default_factory=dict)

    def content(self) -> dict[str, Any]:
        """Return plain data for JSON, in the units of the joint in force."""
        found: dict[str, Any] = _in_units(self._content())
        return found

    def _content(self) -> dict[str, Any]:
        return {
            "joint": joint_in_force().name,
            "verdict": self.verdict,
            "effects": self.effects,
            "localisation": self.localisation,
            "fit": self.fit,
            "alternatives": self.alternatives,
            "reasons": self.reasons,
            "parameters": self.parameters,
            "variability": self.variability,
            "rig": self.rig,
            "recording": self.recording,
        }

    def save(self, path: Path) -> None:
        """Write ``verdict.json``."""
        path.write_text(json.dumps(self.content(), indent=1, allow_nan=False, default=float) + "\n")


def _in_units(found: Any) -> Any:
    """Return texts and keys with the units of the joint in force."""
    joint = joint_in_force()
    if not joint.linear:
        return found
    if isinstance(found, str):
        return joint.in_units(found)
    if isinstance(found, dict):
        return {joint.in_units(key): _in_units(value) for key, value in found.items()}
    return [_in_units(value) for value in found] if isinstance(found, list | tuple) else found


def effect_entry(
    effect: Effect, found: Found, stated: Fit, size: Size, first: bool, standing: Standing
) -> dict[str, Any]:
    """Return one effect of ``verdict.json``.

    Parameters
    ----------
    effect
        The one of what was found.
    found
        All that was found.
    stated
        The augmented model with the values that are stated.
    size
        How much torque it is.
    first
        Whether it is the largest.
    standing
        Of the augmented model. A parameter of this effect at the end of its range criticises a
        complete one, and so does a term that imitates others.
    """
    name = effect.trial.name
    term = term_library()[name]
    rivals = effect.rivals[: LARGEST_SET - 1]
    odds = [1.0] + [
        float(np.exp(-max(t.fit.score / found.compared.score - 1.0, 0.0) / ODDS_SCALE))
        for t in rivals
    ]
    if standing is Standing.COMPLETE and (
        term.imitates or any(label.startswith(f"{name}.") for label in found.final.stopped)
    ):
        standing = Standing.CRITICISED
    of_name, of_its_family = CERTAINTY[first, standing]
    family = term.family or name
    own = sum(
        chance
        for other, chance in zip((name, *(t.name for t in rivals)), odds, strict=True)
        if (term_library()[other].family or other) == family
    )
    probability, of_family = of_name / sum(odds), of_its_family * own / sum(odds)
    by_name = probability >= MIN_STATED_PROBABILITY or of_family <= probability
    values, errors = stated.values[name], stated.errors.get(name, {})
    return {
        "name": name,
        "family": family,
        "stated": name if by_name else family,
        "belongs_to": term.belongs_to.value,
        "location": term.place.value,
        "parameters": {
            p.key: [values[p.symbol], errors.get(p.symbol)] for p in term.parameters if p.fitted
        },
        "probability": round(probability, 3),
        "family_probability": round(of_family, 3),
        "set_probability": of_its_family,
        "tentative": standing in (Standing.INCOMPLETE, Standing.UNEXPLAINED),
        "set": [name, *(t.name for t in rivals)],
        "gain_held_out": [round(g, 4) for g in effect.trial.held_out],
        "excluded": effect.excluded,
        "sentence": sentence_of(name, values, size),
    }


def finding_entry(finding: Finding) -> dict[str, Any]:
    """Return what the signals themselves show, as an effect."""
    term = term_library().get(finding.name)
    return {
        "name": finding.name,
        "stated": finding.name,
        "family": "gain or lag of a channel" if term is None else term.family,
        "belongs_to": "rig",
        "location": finding.location,
        "parameters": {key: list(value) for key, value in finding.parameters.items()},
        "probability": 0.95,
        "family_probability": 0.95,
        "set_probability": 0.95,
        "tentative": False,
        "set": [finding.name, *finding.siblings],
        "sentence": finding.sentence,
    }


def alternatives(found: Found) -> list[dict[str, Any]]:
    """Return rivals that could not be excluded, and terms that were nearly accepted;
    ``delta_score`` is the BIC of the chosen model minus that with the other term: above 0 the other
    term fits better for its number of parameters.
    """
    listed = []
    chosen = found.compared
    n = len(chosen.residual)
    for effect in found.effects:
        for trial in effect.rivals:
            delta = -n * float(np.log(trial.fit.score / chosen.score)) - (
                trial.fit.size - chosen.size
            ) * float(np.log(n))
            listed.append(
                {
                    "name": trial.name,
                    "instead_of": effect.trial.name,
                    "delta_score": round(delta, 1),
                    "model": trial.fit.values,
                }
            )
    listed += [
        {"name": t.name, "instead_of": None, "delta_score": round(-t.bic, 1), "model": t.fit.values}
        for t in found.near
        if t.gain > 0
    ]
    return listed


def separating_measurements(effects: list[dict[str, Any]]) -> list[str]:
    """Return what to measure next to tell the members of each set apart."""
    advice = []
    for effect in effects:
        names = set(effect["set"])
        if len(names) < 2:
            continue
        ways = [
            term_library()[name].separated_by
            for name in effect["set"]
            if name in term_library() and term_library()[name].separated_by
        ]
        way = (
            " or ".join(dict.fromkeys(ways))
            if ways
            else "a second recording with other step sizes, rise times and intervals"
        )
        advice.append(
            f"{', '.join(sorted(names))} fit about equally well; {way} would tell them apart"
        )
    return advice


def repetition(effects: list[dict[str, Any]]) -> list[str]:
    """Return what tentative effects need before they count; nothing where there are none."""
    names = [effect["name"].replace("_", " ") for effect in effects if effect["tentative"]]
    if not names:
        return []
    return [
        f"A tentative effect ({', '.join(names)}) needs a second recording of the same kind: it "
        "must come out again with the same sign and size."
    ]


def before_and_after(
    base: dict[str, tuple[float, float | None]], final: dict[str, tuple[float, float | None]]
) -> dict[str, dict[str, Any]]:
    """Return the impedance at the operating point before and after the new physics is in the model,
    without a quantity that a model does not tell.
    """
    return {
        key: {
            "base": base[key][0],
            "augmented": value,
            "standard_error": None if error is None or not math.isfinite(error) else error,
        }
        for key, (value, error) in final.items()
        if math.isfinite(value) and math.isfinite(base[key][0])
    }


def on_impedance(
    without: dict[str, tuple[float, float | None]], with_it: dict[str, tuple[float, float | None]]
) -> dict[str, list[float | None]]:
    """Return what an effect does to K and G: each without it, with it, and its standard error.

    Parameters
    ----------
    without, with_it
        Impedance at the operating point of the model refitted without the effect, and of the whole.
    """
    return {
        key: [without[key][0], *with_it[key]] for key in with_it if key.startswith(("K[", "G["))
    }
