"""Rank movements by how well they tell rival models apart.

For each pair of a set, one model makes the torque on a candidate movement and the other is refitted
to it; what then remains of the whitened torque is the noncentrality that a second recording would
have against the wrong one (Atkinson & Fedorov 1975, Biometrika 62, 57: T-optimality, as an expected
log-likelihood ratio). The whitening is that of the recording's own residual, so that its noise
counts as it was. A movement is worth its worst pair, of those that any movement within the limits
can decide: a pair that none decides is named, and hides no other.

All candidates are ranked with the rival refitted by one linear step; the best few are then refitted
in full.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from itertools import permutations
from typing import Any

import numpy as np

from ankle_physics.term import ModelValues, Place, term_library
from model_discrepancy.fit.columns import Columns
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.least_squares import orthonormal
from model_discrepancy.fit.rows import Rows
from model_discrepancy.search.exchange import RIVAL_EXCESS
from model_discrepancy.tools.candidate_movements import Candidate, candidates_for

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

    models: dict[str, ModelValues]
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


def _by_activation(values: ModelValues) -> bool:
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


def _fitter(columns: Columns, true: ModelValues) -> Fitter:
    """Return a fitter whose torque is made by the true model; it shares what columns remember."""
    own = copy(columns)
    own.target = columns.torque(true)
    return Fitter(own)


def _misfit(fitter: Fitter, wrong: ModelValues, refit: bool) -> float:
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
