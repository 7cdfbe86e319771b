"""The best perturbation separates rival explanations.

It is chosen by the expected discrimination between fitted models.

For each pair of a set, one model makes the torque on a candidate movement and the other is refitted
to it; what then remains of the whitened torque is the noncentrality that a second recording would
have against the wrong one (Atkinson & Fedorov 1975, Biometrika 62, 57: T-optimality, as an expected
log-likelihood ratio). The whitening is that of the recording's own residual, so that its noise
counts as it was. A design is worth its worst pair.

All candidates are ranked with the rival refitted by one linear step; the best few are then refitted
in full.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from matplotlib.figure import Figure

from ankle_physics.model import Model
from ankle_physics.term import Place, term_library
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.fit.columns import Columns
from model_discrepancy.fit.fitter import Fitter, orthonormal
from model_discrepancy.fit.rows import Rows
from model_discrepancy.recording.motion import Motion
from model_discrepancy.report.verdict import separating_measurements
from model_discrepancy.search.term_search import RIVAL_EXCESS
from model_discrepancy.tools.candidate_movements import Candidate, candidates_for

Values = dict[str, dict[str, float]]
# Enough movements (60 and more) for an expectation, little enough to compute for dozens of
# candidates.
SIMULATED_S = 30.0
# Whitened misfit, twice the log-likelihood ratio, at which the wrong one of two models has lost.
DECIDING_MISFIT = 50.0
REFITTED_DESIGNS = 5
# Shorter recordings give few stretches to judge on unseen data.
LEAST_MINUTES = 1.0
LISTED_DESIGNS = 12
# A picture of the movement, in which single edges are still seen.
_SHOWN_S = 6.0


@dataclass(frozen=True)
class RivalSet:
    """Models that one recording could not tell apart.

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
    """A candidate and what it is expected to tell.

    Attributes
    ----------
    excess
        Expected excess of whitened error of the wrong model of the worst pair, 0...1 and more.
    misfit
        The same as whitened sum of squares per minute.
    pair
        (true, wrong) of that pair.
    refitted
        Whether the wrong model was refitted in full.
    """

    candidate: Candidate
    excess: float
    misfit: float
    pair: tuple[str, str]
    refitted: bool = False

    @property
    def minutes(self) -> float:
        """Recording time [min] after which the wrong model has lost."""
        return DECIDING_MISFIT / self.misfit if self.misfit > 0 else float("inf")


@dataclass(frozen=True)
class Design:
    """The ranking, best first, for the sets of a verdict.

    Attributes
    ----------
    other
        Measurements beside position and torque that would tell as well, one sentence each.
    """

    sets: list[RivalSet]
    proposals: list[Proposal]
    other: list[str]

    @property
    def sentence(self) -> str:
        """The proposal in one sentence."""
        if not self.sets:
            return "The verdict leaves no rivals: no second recording is needed to tell them apart."
        best = self.proposals[0]
        now = min(s.excess for s in self.sets)
        true, wrong = (name.replace("_", " ") for name in best.pair)
        worth = f"{100 * best.excess:.1f} % more whitened error with the wrong explanation"
        if best.excess < RIVAL_EXCESS:
            return (
                f"No perturbation within the limits tells {true} from {wrong}: the best, "
                f"{best.candidate.title}, leaves {worth}, "
                f"and {100 * RIVAL_EXCESS:g} % are needed. {' '.join(self.other)}".strip()
            )
        return (
            f"Record {max(best.minutes, LEAST_MINUTES):.1f} minutes or more of "
            f"{best.candidate.title}: "
            f"the hardest pair, {true} and {wrong}, "
            f"is expected to leave {worth} (this recording: {100 * now:.1f} %; "
            f"{100 * RIVAL_EXCESS:g} % exclude it)."
        )

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
    """The ranking of candidate perturbations for a verdict.

    Parameters
    ----------
    verdict
        ``verdict.json`` of a diagnosis, or its folder; ``model.yaml`` lies beside it.
    progress
        Called with one line for each step.

    Raises
    ------
    DiagnosisError
        No such verdict, or one without models (a bad recording).
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
    sets = rival_sets(content, path.parent / "model.yaml")
    other = [
        sentence
        for sentence in separating_measurements(content["effects"])
        if "EMG" in sentence or "foot out" in sentence
    ]
    if not sets:
        return Design([], [], other)
    return Design(sets, rank(sets, content["recording"], progress), other)


def rival_sets(content: dict[str, Any], model_file: Path) -> list[RivalSet]:
    """The sets of a verdict's content with more than one member."""
    chosen: Values = {
        e.term.name: {s: float(v) for s, v in e.values.items()}
        for e in Model.load(model_file).entries
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
) -> list[Proposal]:
    """Candidates by the misfit of their worst pair, best first; those refitted in full lead.

    Parameters
    ----------
    sets
        Of rivals.
    conditions
        The verdict's ``recording``.
    progress
        Called with one line for each step.
    """
    levels = any(_by_activation(values) for s in sets for values in s.models.values())
    candidates = candidates_for(float(conditions["movement[rad]"]), levels)
    first = []
    for number, candidate in enumerate(candidates):
        progress(f"movement {number + 1} of {len(candidates)}: {candidate.title}")
        first.append(_worth(candidate, sets, conditions, refit=False))
    first.sort(key=lambda p: -p.misfit)
    final = []
    for proposal in first[:REFITTED_DESIGNS]:
        progress(f"refitting the rivals on {proposal.candidate.title}")
        final.append(_worth(proposal.candidate, sets, conditions, refit=True))
    return sorted(final, key=lambda p: -p.misfit) + first[REFITTED_DESIGNS:]


def _by_activation(values: Values) -> bool:
    """Say whether a model holds a term that follows the subject's own torque."""
    return any(
        term_library()[name].place is Place.ACTIVATION or name.startswith("activation")
        for name in values
    )


def _worth(
    candidate: Candidate, sets: list[RivalSet], conditions: dict[str, Any], refit: bool
) -> Proposal:
    motion = candidate.motion(SIMULATED_S, float(conditions["background_torque[N.m]"]))
    found = []
    for models in (s.models for s in sets):
        for true, wrong in permutations(models, 2):
            # Every pair with the chosen model; rivals among each other need no decision.
            if next(iter(models)) in (true, wrong):
                fitter = _fitter(motion, models[true], np.array(conditions["whitening[1/N.m]"]))
                found.append((_misfit(fitter, models[wrong], refit), (true, wrong), fitter))
    score, pair, fitter = min(found, key=lambda entry: entry[0])
    count = int(fitter.rows.used.sum())
    return Proposal(candidate, score / count, score / count * fitter.rows.rate * 60.0, pair, refit)


def _fitter(motion: Motion, true: Values, whitening: np.ndarray) -> Fitter:
    """A fitter whose torque is made by the true model, whitened as the recording was."""
    rows = Rows(len(motion.position), motion.rate)
    rows.whiten_with(whitening)
    columns = Columns(motion, rows)
    columns.target = sum(
        (true[n][s] * spectrum for (n, s), spectrum in columns.spectra(true).items()),
        np.zeros_like(columns.target),
    )
    return Fitter(columns)


def _misfit(fitter: Fitter, wrong: Values, refit: bool) -> float:
    """Whitened sum of squares that the wrong model leaves after its refit, or after one linear step
    towards it.
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
    """The proposed movement, and the worst pair's excess of each candidate."""
    figure = Figure(figsize=(11, 4.2))
    left, right = figure.subplots(1, 2)
    best = design.proposals[0].candidate
    reference = best.reference(_SHOWN_S)
    left.plot(np.arange(len(reference)) / 2048.0, 1000 * reference[:, 0], color="k", lw=1.0)
    left.set_xlabel("time [s]")
    left.set_ylabel("commanded position [mrad]")
    left.set_title(best.title, fontsize=9)
    listed = design.proposals[:LISTED_DESIGNS]
    right.barh(
        [p.candidate.title for p in listed],
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
