"""One term of a family is tried in the place of several.

Terms of one family imitate each other: beside a resonance of the torque sensor a search may end
where the straps are rigid, though straps alone would explain more. A fit does not find back from
there, so each term of the family is begun anew from its grid without the others. A term of another
family that states that it is imitated by one of these belongs to them (`Term.imitated_by`).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from ankle_physics.term import ModelValues, term_library
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.parallel import in_parallel
from model_discrepancy.search.candidates import begun_anew
from model_discrepancy.search.found import Effect, Found, Progress, Trial
from model_discrepancy.search.grids import Grids
from model_discrepancy.search.null import Null
from model_discrepancy.search.screening import without_term
from model_discrepancy.search.trials import fixed_errors, refitted

# Beside many other terms, whose values follow slowly.
EVALUATIONS = 40
# What several terms take off by chance is a small share; all of it would leave no limit.
LARGEST_BY_CHANCE = 0.5


def unite(
    fitter: Fitter,
    found: Found,
    grids: Grids,
    null: Null,
    yardstick: np.ndarray,
    progress: Progress,
) -> bool:
    """Put one term of a family in the place of all of its family, where these take off no more than
    by chance beyond it. Return whether any was put so.

    Parameters
    ----------
    fitter
        Whitened by the recording's noise.
    found
        With the final model; changed.
    grids
        Of the library that may be named.
    null
        What each term gains by chance.
    yardstick
        Gain of a fixed whitening at each frequency of the rows.
    progress
        Called with one line for each family.
    """
    united = False
    for family, members in _imitating(found).items():
        if not family or len(members) < 2:
            continue
        names = [effect.trial.name for effect in members]
        progress(f"{family}: one term for {', '.join(names)}")
        thresholds = {name: null.threshold_of(name, found.final) for name in names}
        bare = bare_of(fitter, found.final, names)
        trials = in_parallel(partial(_alone, fitter, found, bare, thresholds, grids), names)
        best = min(trials, key=lambda trial: trial.fit.score)
        by_chance = _by_chance_beside(best.name, thresholds)
        if 1.0 - found.final.score / best.fit.score < by_chance:
            _put(fitter, found, members, best, yardstick)
            united = True
    return united


def _imitating(found: Found) -> dict[str, list[Effect]]:
    """Return the effects that imitate each other, by the name of their family."""
    library, families = term_library(), defaultdict(list)
    for effect in found.effects:
        families[library[effect.trial.name].family].append(effect)
    for effect in found.effects:
        name = effect.trial.name
        for other in library[name].imitated_by(found.final.values):
            family = library[other].family
            if families.get(family) and effect not in families[family]:
                families[library[name].family].remove(effect)
                families[family] = [
                    e for e in found.effects if e is effect or e in families[family]
                ]
                break
    return families


def _by_chance_beside(name: str, thresholds: Mapping[str, float]) -> float:
    """Return what the other terms of a family take off by chance, of these thresholds."""
    return sum(threshold for other, threshold in thresholds.items() if other != name)


def bare_of(fitter: Fitter, final: Fit, members: Sequence[str], evaluations: int = 15) -> Fit:
    """Return a model refitted without some of its terms.

    Parameters
    ----------
    fitter
        Whitened by the recording's noise.
    final
        The model.
    members
        Terms that are left out.
    evaluations
        Of the refit, at most.
    """
    terms: Sequence[str] = final.terms
    for member in members:
        terms = without_term(terms, member)
    return fitter.fit(terms, final.values, evaluations=evaluations)


def _alone(
    fitter: Fitter,
    found: Found,
    bare: Fit,
    thresholds: Mapping[str, float],
    grids: Grids,
    name: str,
) -> Trial:
    """Return the best model with one term of a family instead of these members, which each have a
    threshold. A refit that cannot come near what all of them take off ends early.
    """
    members = list(thresholds)
    by_chance = min(_by_chance_beside(name, thresholds), LARGEST_BY_CHANCE)
    limit = found.final.score / (1.0 - by_chance)
    # The others as they are beside the family: without it, they stand in for a part of it.
    others = {term: found.final.values[term] for term in bare.terms}
    anew = begun_anew(fitter, bare, name, grids.whole(name), EVALUATIONS, others, limit)
    swings_alike = [
        refitted(fitter, bare, name, {**others, **start}, EVALUATIONS, limit)
        for start in _imitations(found, name, members)
    ]
    return max([anew, *swings_alike], key=lambda trial: trial.gain)


def _imitations(found: Found, name: str, members: Sequence[str]) -> list[ModelValues]:
    """Return the values at which this term, or the special case that it holds, makes nearly the
    torque of another one of these members.
    """
    library, starts = term_library(), []
    for member in members:
        for other, start in library[member].imitated_by(found.final.values).items():
            if other == name or other in library[name].generalises:
                own = {p.symbol: p.default for p in library[name].parameters}
                turn = library[name].turn
                neutral = {} if turn is None else {turn.symbol: turn.neutral}
                starts.append({**start, name: own | neutral | start[other]})
    return starts


def _put(
    fitter: Fitter, found: Found, members: Sequence[Effect], best: Trial, yardstick: np.ndarray
) -> None:
    """Put a term in the place of the first of these effects, and remove the others."""
    first = found.effects.index(members[0])
    found.effects = [effect for effect in found.effects if effect not in members]
    found.effects.insert(first, Effect(best, members[0].errors))
    found.final = best.fit
    found.effects[-1].errors = fixed_errors(best.fit, yardstick)
