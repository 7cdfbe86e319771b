"""One term is tried in the place of two.

Two terms may share what one other term explains: dry friction and a damping that levels off make
together what a damping does that follows a power of the speed. No exchange of one term for another
finds that, since beside the second one the right term seems to be a rival that fits about as well.
So each rival of an effect is fitted without each of the other terms, too.
"""

from __future__ import annotations

from dataclasses import replace

from model_discrepancy.fit.base_model import bic_change
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.parallel import in_parallel
from model_discrepancy.search.found import Effect, Found, Progress, Trial
from model_discrepancy.search.harm import harms
from model_discrepancy.search.null import Null
from model_discrepancy.search.screening import without_term

# Of a rival's fit without the other term, of which it has to take over a part.
EVALUATIONS = 40

_Option = tuple[Effect, Trial, Effect]


def one_for_two(
    fitter: Fitter, found: Found, null: Null, progress: Progress
) -> tuple[Effect, Trial] | None:
    """Remove a term that is superfluous beside the rival of an effect, and return this effect and
    the rival, which takes its place; None where there is no such rival, or the recording needs many
    terms, of which each stands in for a part of others.

    The model with the rival leaves no more error than the term that goes takes off by chance, and
    predicts unseen torque no worse.

    Parameters
    ----------
    fitter
        Whitened by the recording's noise.
    found
        With the final model, and the rivals of each effect; changed.
    null
        What each term gains by chance.
    progress
        Called with one line where a term goes.
    """
    if found.needs_many_terms:
        return None
    options = [
        (effect, rival, other)
        for effect in found.effects
        for rival in effect.rivals
        for other in (*found.effects, *found.refinements)
        if other is not effect
    ]
    tried = in_parallel(lambda option: _without(fitter, found, null, *option), options)
    good = [option for option in tried if option is not None]
    best = min(good, key=lambda option: option[1].fit.score, default=None)
    if best is None or harms(fitter, found.final, best[1].fit):
        return None
    effect, rival, other = best
    progress(f"{other.trial.name} is superfluous beside {rival.name}")
    (found.effects if other in found.effects else found.refinements).remove(other)
    return effect, rival


def _without(
    fitter: Fitter, found: Found, null: Null, effect: Effect, rival: Trial, other: Effect
) -> _Option | None:
    """Return a rival fitted in the place of an effect and another one; None where it leaves more
    error than this one takes off by chance.
    """
    name = other.trial.name
    limit = found.final.score / (1.0 - null.threshold_of(name, found.final))
    terms = without_term(rival.fit.terms, name)
    fit = fitter.fit_below(terms, rival.fit.values, limit, EVALUATIONS)
    if fit.score > limit:
        return None
    return effect, replace(rival, fit=fit, bic=bic_change(fitter, found.final, fit)), other
