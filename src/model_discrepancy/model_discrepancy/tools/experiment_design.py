"""Propose the perturbation that best separates rival explanations of a recording."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from matplotlib.figure import Figure

from ankle_physics.joint_profile import JointProfile, joint_in_force
from ankle_physics.model import Model
from ankle_physics.term import ModelValues
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.report.verdict import repetition, separating_measurements
from model_discrepancy.search.exchange import RIVAL_EXCESS
from model_discrepancy.tools.known_terms import load_model, require_terms
from model_discrepancy.tools.movement_ranking import (
    LARGEST_EXCESS,
    SIMULATED_S,
    Pair,
    Proposal,
    RivalSet,
    percent,
    rank,
)

# Shorter recordings give few stretches to judge on unseen data.
LEAST_MINUTES = 1.0
LISTED_DESIGNS = 12
# A picture of the movement, in which single edges are still seen.
_SHOWN_S = 6.0
# Conditions of a recording that a verdict states in the units of its joint; here in an ankle's.
_CONDITIONS = (
    "movement[rad]",
    "movement_rms[rad]",
    "background_torque[N.m]",
    "whitening_rate[Hz]",
    "whitening[1/N.m]",
)


@dataclass(frozen=True)
class Design:
    """Ranks the movements, best first, for the sets of a verdict.

    Attributes
    ----------
    other
        Measurements beside position and torque that would tell as well, one sentence each.
    unsettled
        What another recording is needed for, whatever the rivals; one sentence each.
    joint
        In whose units the sentences are; the joint in force when the design was made.
    """

    sets: list[RivalSet]
    proposals: list[Proposal]
    other: list[str]
    unsettled: list[str] = field(default_factory=list)
    joint: JointProfile = field(default_factory=joint_in_force)

    @property
    def undecided(self) -> list[Pair]:
        """Return the pairs, in either order once, that the best movement does not decide."""
        if not self.proposals:
            return []
        pairs = self.proposals[0].pairs
        return [
            (a, b)
            for a, b in pairs
            if a < b and min(pairs[a, b], pairs.get((b, a), pairs[a, b])) < RIVAL_EXCESS
        ]

    @property
    def sentence(self) -> str:
        """Return the proposal in one sentence, in the units of the joint."""
        return self.joint.in_units(self._sentence())

    def _sentence(self) -> str:
        if not self.sets:
            return "The verdict leaves no rivals to tell apart."
        best = self.proposals[0]
        now = min(s.excess for s in self.sets)
        true, wrong = (name.replace("_", " ") for name in best.pair)
        least = "at least " if best.excess >= LARGEST_EXCESS else ""
        worth = f"{least}{percent(best.excess)} % more whitened error with the wrong explanation"
        if best.excess < RIVAL_EXCESS:
            return (
                f"No perturbation within the limits tells {true} from {wrong}: the best, "
                f"{best.candidate.title}, leaves {worth}, "
                f"and {100 * RIVAL_EXCESS:g} % exclude it in one recording. "
                f"{' '.join(self.other)}".strip()
            )
        hidden = [" from ".join(name.replace("_", " ") for name in pair) for pair in self.undecided]
        left = f" It does not tell {', nor '.join(hidden)}." if hidden else ""
        return (
            f"Record {max(best.minutes, LEAST_MINUTES):.1f} minutes or more of "
            f"{best.candidate.title}: "
            f"the hardest pair, {true} and {wrong}, "
            f"is expected to leave {worth} (this recording: {percent(now)} %).{left}"
        )

    @property
    def sentences(self) -> list[str]:
        """Return the proposal, other measurements, and what else needs another recording."""
        found = [self.sentence, *self.other, *self.unsettled]
        if len(found) == 1 and not self.sets:
            found.append("It leaves nothing open that needs a second recording.")
        return found

    def save(self, folder: Path) -> None:
        """Write ``design.yaml``, a parameter file of the perturbation generator, and
        ``design.png``.
        """
        folder.mkdir(parents=True, exist_ok=True)
        if not self.proposals:
            return
        content = {
            "perturbation_generator": {"ros__parameters": self.proposals[0].candidate.parameters}
        }
        text = f"# {self.sentence}\n" + yaml.safe_dump(content, sort_keys=False)
        (folder / "design.yaml").write_text(text)
        _picture(self).savefig(folder / "design.png", dpi=110, bbox_inches="tight")


def design_experiment(
    verdict: str | Path, progress: Callable[[str], None] = lambda _: None
) -> Design:
    """Return the ranking of candidate perturbations for a verdict.

    Parameters
    ----------
    verdict
        ``verdict.json`` of a diagnosis, or its folder; ``model.yaml`` lies beside it.
    progress
        Called with one line for each step.

    Raises
    ------
    DiagnosisError
        No such verdict, one without models (a bad recording), or one with a term that the library
        lacks.
    """
    path = Path(verdict)
    path = path / "verdict.json" if path.is_dir() else path
    try:
        content = json.loads(path.read_text())
    except (OSError, json.JSONDecodeError) as error:
        raise DiagnosisError(f"{path} is not a verdict of 'diagnose': {error}") from None
    if not isinstance(content, dict) or "verdict" not in content:
        raise DiagnosisError(f"{path} is not a verdict of 'diagnose': it lacks 'verdict'")
    if content["verdict"] == "bad_recording":
        raise DiagnosisError(f"{path}: a bad recording has no rivals; record again first")
    chosen = load_model(path.parent / "model.yaml")
    alternatives = (a for a in content["alternatives"] if a["instead_of"] is not None)
    require_terms(dict.fromkeys(name for a in alternatives for name in a["model"]), path)
    other = [
        sentence
        for sentence in separating_measurements(content["effects"])
        if "EMG" in sentence or "foot out" in sentence
    ]
    with chosen.joint.in_force():
        sets = rival_sets(content, chosen)
        proposals = rank(sets, _conditions(content["recording"]), progress) if sets else []
        return Design(sets, proposals, other, open_questions(content))


def _conditions(stated: dict[str, Any]) -> dict[str, Any]:
    """Return a verdict's ``recording`` by the names that it has for an ankle."""
    joint = joint_in_force()
    named = {name: joint.in_units(name) for name in _CONDITIONS}
    return {name: stated[key] for name, key in named.items() if key in stated}


def open_questions(content: dict[str, Any]) -> list[str]:
    """Return what a verdict's content leaves open that needs another recording."""
    found = repetition(content["effects"])
    if content["verdict"] == "unexplained":
        found.append(
            "What is missing has no name yet: another recording with other step sizes, rise times "
            "and positions may show what it depends on."
        )
    return found


def rival_sets(content: dict[str, Any], model: Model) -> list[RivalSet]:
    """Return the sets of a verdict's content with more than one member; the chosen one is that of
    the model.
    """
    chosen: ModelValues = {
        e.term.name: {s: float(v) for s, v in e.values.items()} for e in model.entries
    }
    rows = content["recording"]["duration[s]"] * content["recording"]["whitening_rate[Hz]"]
    sets = []
    for effect in content["effects"]:
        rivals = [a for a in content["alternatives"] if a["instead_of"] == effect["name"]]
        if rivals:
            excess = min(float(np.expm1(max(-a["delta_score"], 0.0) / rows)) for a in rivals)
            sets.append(
                RivalSet(
                    {effect["name"]: chosen, **{a["name"]: a["model"] for a in rivals}}, excess
                )
            )
    return sets


def _picture(design: Design) -> Figure:
    """Draw the proposed movement, and the worst pair's excess of each candidate."""
    figure = Figure(figsize=(11, 4.2))
    left, right = figure.subplots(1, 2)
    best = design.proposals[0].candidate
    # A signal is at least as long as its longest cycle, which may be longer than what is shown.
    reference = best.reference(SIMULATED_S)[: round(_SHOWN_S * 2048.0)]
    left.plot(np.arange(len(reference)) / 2048.0, 1000 * reference[:, 0], color="k", lw=1.0)
    left.set_xlabel("time [s]")
    left.set_ylabel(design.joint.in_units("commanded position [mrad]"))
    left.set_title(design.joint.in_units(best.title), fontsize=9)
    listed = design.proposals[:LISTED_DESIGNS]
    right.barh(
        [design.joint.in_units(p.candidate.title) for p in listed],
        [100 * p.excess for p in listed],
        color=["#1f6fb4" if p.refitted else "0.75" for p in listed],
    )
    right.axvline(100 * RIVAL_EXCESS, color="#c8372d", lw=1.0, label="excludes the wrong one")
    right.invert_yaxis()
    right.tick_params(axis="y", labelsize=7)
    right.set_xlabel("expected excess of whitened error, worst pair [%] (grey: without refit)")
    right.legend(fontsize=8)
    figure.tight_layout()
    return figure
