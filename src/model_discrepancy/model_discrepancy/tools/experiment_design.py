"""The best perturbation separates rival explanations.

It is chosen by the expected discrimination between fitted models.

For each pair of a set, one model makes the torque on a candidate movement and the other is refitted
to it; what then remains of the whitened torque is the noncentrality that a second recording would
have against the wrong one (Atkinson & Fedorov 1975, Biometrika 62, 57: T-optimality, as an expected
log-likelihood ratio). The whitening is that of the recording's own residual, so that its noise
counts as it was. A design is worth its worst pair, of those that any movement within the limits
can decide: a pair that none decides is named, and hides no other.

All candidates are ranked with the rival refitted by one linear step; the best few are then refitted
in full.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, field
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from matplotlib.figure import Figure

from ankle_physics.joint_profile import JointProfile, joint_in_force
from ankle_physics.model import Model
from ankle_physics.term import Place, term_library
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.fit.columns import Columns
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.least_squares import orthonormal
from model_discrepancy.fit.rows import Rows
from model_discrepancy.report.verdict import repetition, separating_measurements
from model_discrepancy.search.exchange import RIVAL_EXCESS
from model_discrepancy.tools.candidate_movements import Candidate, candidates_for
from model_discrepancy.tools.known_terms import load_model, require_terms

Values = dict[str, dict[str, float]]
Pair = tuple[str, str]
# Enough movements (60 and more) for an expectation, little enough to compute for dozens of
# candidates.
SIMULATED_S = 30.0
# Whitened misfit, twice the log-likelihood ratio, at which the wrong one of two models has lost.
DECIDING_MISFIT = 50.0
# No more than this is expected: a rival that leaves more is far from the movements to which it was
# fitted (a reflex that grows with position runs away), and by how much says nothing.
LARGEST_EXCESS = 10.0
REFITTED_DESIGNS = 5
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


def percent(share: float) -> str:
    """Return a share of whitened error in per cent, as text; beyond `LARGEST_EXCESS` only that.

    Parameters
    ----------
    share
        As a fraction of 1.
    """
    if share > LARGEST_EXCESS:
        return f"more than {100 * LARGEST_EXCESS:.0f}"
    return f"{100 * share:.1f}"


@dataclass(frozen=True)
class RivalSet:
    """Holds models that one recording could not tell apart.

    Attributes
    ----------
    models
        Fitted values by term and symbol, by the name of the term in which they differ; the chosen
        one first.
    excess
        Smallest excess of whitened error of a rival in the recording itself, 0...1.
    """

    models: dict[str, Values]
    excess: float


@dataclass(frozen=True)
class Proposal:
    """Holds a candidate and what it is expected to tell.

    Attributes
    ----------
    excess
        Expected excess of whitened error of the wrong model of the worst pair, 0...1 and more.
    misfit
        The same as whitened sum of squares per minute.
    pair
        (true, wrong) of that pair.
    pairs
        Expected excess of each pair (true, wrong).
    refitted
        Whether the wrong model was refitted in full.
    """

    candidate: Candidate
    excess: float
    misfit: float
    pair: Pair
    pairs: dict[Pair, float]
    refitted: bool = False

    @property
    def minutes(self) -> float:
        """Return the recording time [min] after which the wrong model has lost."""
        return DECIDING_MISFIT / self.misfit if self.misfit > 0 else float("inf")

    def misfit_of(self, one: str, other: str) -> float:
        """Return the expected misfit of the wrong one of a pair, whichever it is, as whitened sum
        of squares per minute.
        """
        least = min(self.pairs[one, other], self.pairs[other, one])
        return least * self.misfit / self.excess if self.excess > 0.0 else 0.0


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
    chosen: Values = {
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


def rank(
    sets: list[RivalSet],
    conditions: dict[str, Any],
    progress: Callable[[str], None] = lambda _: None,
    made: Sequence[str] = (),
) -> list[Proposal]:
    """Rank candidates by the misfit of their worst pair, best first; those refitted in full lead.

    Parameters
    ----------
    sets
        Of rivals.
    conditions
        The verdict's ``recording``, by the names that it has for an ankle.
    progress
        Called with one line for each step.
    made
        Titles of movements that left the rivals open already: the same again would, too.
    """
    levels = any(_by_activation(values) for s in sets for values in s.models.values())
    candidates = [
        candidate
        for candidate in candidates_for(
            float(conditions["movement[rad]"]),
            levels,
            float(conditions.get("movement_rms[rad]", math.inf)),
        )
        if candidate.title not in made
    ]
    tried = []
    for number, candidate in enumerate(candidates):
        progress(f"movement {number + 1} of {len(candidates)}: {candidate.title}")
        tried.append((candidate, _excesses(candidate, sets, conditions, refit=False), False))
    first = _ranked(tried, conditions)
    final = []
    for proposal in first[:REFITTED_DESIGNS]:
        progress(f"refitting the rivals on {proposal.candidate.title}")
        excesses = _excesses(proposal.candidate, sets, conditions, refit=True)
        final.append((proposal.candidate, excesses, True))
    return _ranked(final, conditions) + first[REFITTED_DESIGNS:]


def _ranked(
    tried: list[tuple[Candidate, dict[Pair, float], bool]], conditions: dict[str, Any]
) -> list[Proposal]:
    """Rank proposals by their worst pair, best first; pairs that no candidate decides do not count
    unless there are no others.
    """
    if not tried:
        return []
    pairs = list(tried[0][1])
    decidable = [
        pair for pair in pairs if max(found[pair] for _, found, _ in tried) >= RIVAL_EXCESS
    ] or pairs
    rows = 60.0 * float(conditions["whitening_rate[Hz]"])
    proposals = []
    for candidate, found, refitted in tried:
        pair = min(decidable, key=lambda p, found=found: found[p])  # type: ignore[misc]
        worst = found[pair]
        proposals.append(Proposal(candidate, worst, worst * rows, pair, found, refitted))
    return sorted(proposals, key=lambda p: -p.excess)


def _by_activation(values: Values) -> bool:
    """Say whether a model holds a term that follows the subject's own torque."""
    return any(
        term_library()[name].place is Place.ACTIVATION or name.startswith("activation")
        for name in values
    )


def _excesses(
    candidate: Candidate, sets: list[RivalSet], conditions: dict[str, Any], refit: bool
) -> dict[Pair, float]:
    """Return expected excess of whitened error of the wrong model of each pair (true, wrong)."""
    motion = candidate.motion(SIMULATED_S, float(conditions["background_torque[N.m]"]))
    rows = Rows(len(motion.position), motion.rate)
    rows.whiten_with(np.array(conditions["whitening[1/N.m]"]))
    columns = Columns(motion, rows)
    count = int(rows.used.sum())
    found: dict[Pair, float] = {}
    for models in (s.models for s in sets):
        for true, wrong in permutations(models, 2):
            # Every pair with the chosen model; rivals among each other need no decision.
            if next(iter(models)) in (true, wrong):
                fitter = _fitter(columns, models[true])
                excess = _misfit(fitter, models[wrong], refit) / count
                found[true, wrong] = float(np.fmin(excess, LARGEST_EXCESS))
    return found


def _fitter(columns: Columns, true: Values) -> Fitter:
    """Return a fitter whose torque is made by the true model; it shares what columns remember."""
    own = copy(columns)
    own.target = columns.torque(true)
    return Fitter(own)


def _misfit(fitter: Fitter, wrong: Values, refit: bool) -> float:
    """Return the whitened sum of squares that the wrong model leaves after its refit, or after one
    linear step towards it.
    """
    if refit:
        return fitter.fit(list(wrong), wrong, evaluations=20).score
    used = fitter.rows.used
    start = fitter.evaluate(wrong)
    basis = orthonormal(fitter.derivatives(start)[0][used])
    residual = start.residual[used]
    left = residual - basis @ (basis.T @ residual)
    return float(left @ left)


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
