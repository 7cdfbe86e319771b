"""The search for missing terms: screening, joint refit of the best few, accept or stop.

A term is accepted when it takes more off the whitened error than any term of the library does by
chance on noise like this recording's (`null`), when the error falls in both directions between two
halves, and when the torque that it changes matters at all. Deciding by the plain error would never
stop: voluntary torque is autocorrelated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ankle_physics.term import Place, term_library
from model_discrepancy.fit.base_model import (
    ALIGNMENT,
    bic_change,
    has_joint,
    is_alignment,
    reflex_stands_in,
)
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.held_out import HeldOut, held_out
from model_discrepancy.fit.parallel import in_parallel
from model_discrepancy.fit.standard_errors import with_errors
from model_discrepancy.search.chosen_anew import chosen_anew
from model_discrepancy.search.exchange import (
    ends_at_bound,
    exchange,
    name_second_effect,
    specialise,
    try_without,
)
from model_discrepancy.search.flexible_terms import add_flexible, add_further
from model_discrepancy.search.found import REFINEMENT, Effect, Found, Progress, Trial, place_of
from model_discrepancy.search.grids import Grids
from model_discrepancy.search.harm import predicts_worse
from model_discrepancy.search.hypotheses import BEHIND_RATIO, Hypotheses, Hypothesis
from model_discrepancy.search.null import Null
from model_discrepancy.search.screening import with_term, with_turning, without_term
from model_discrepancy.search.shared_families import unite
from model_discrepancy.search.subject_anew import subject_anew
from model_discrepancy.search.time_limit import time_is_over
from model_discrepancy.search.trials import (
    fixed_errors,
    halves_errors,
    halves_gain,
    judged,
)

# The first search, and another one from what its exchange of terms left behind.
MOST_SEARCHES = 2
# A shorter recording does not tell which flexible and further terms last. Chosen in one half of a
# human trial (30 s), they changed the VAF of the other half by +0.2 and -0.4 points; chosen in the
# whole and fitted to one half by +0.4 and +0.5. Nor does it tell what of the subject is found anew:
# in two of four halves another model was taken, which changed that VAF by -0.4 and -0.7.
SHORTEST_COMPLETED_S = 45.0


def search(
    fitter: Fitter,
    base: Fit,
    null: Null,
    library: Sequence[str] | None = None,
    progress: Progress = lambda _: None,
    before: Found | None = None,
) -> Found:
    """Add terms to the base model while they are worth it.

    Parameters
    ----------
    fitter
        Whitened by the recording's noise.
    base
        The base model's fit.
    null
        Surrogates of that noise.
    library
        Terms that may be added; None for all.
    progress
        Called with one line for each step.
    before
        What another search found in this recording; None for a first one.
    """
    grids = Grids(library, fitter.rows.count / fitter.rows.rate)
    yardstick = fitter.rows.gain()
    hypotheses = Hypotheses(fitter, base, null, grids, yardstick, progress)
    best = hypotheses.best(before)
    found = best.found
    for number in range(MOST_SEARCHES):
        if number > 0:
            # Beside the terms that took the place of others, further ones may be worth it.
            best = hypotheses.followed(found)
            found = best.found
        _settle(fitter, base, best, null, yardstick)
        united = unite(fitter, found, grids, null, yardstick, progress)
        specialise(fitter, found, null)
        exchanged = exchange(fitter, found, grids, null, yardstick, progress) or united
        # What further small terms gain beside many does not last. After another search in a half of
        # a human trial, with nine terms, the other half was predicted 2.7 points worse.
        if not exchanged or found.needs_many_terms or time_is_over():
            break
    _score_both(fitter, found, grids, null, progress)
    return found


def complete(
    fitter: Fitter,
    found: Found,
    null: Null,
    library: Sequence[str] | None = None,
    progress: Progress = lambda _: None,
) -> None:
    """Add flexible terms, and what shows beside them, to what the last search of a recording found,
    where it may be completed (`may_be_completed`).

    Parameters
    ----------
    fitter, null, library, progress
        As `search` takes them.
    found
        The search's result; changed.
    """
    if not may_be_completed(fitter, found) or time_is_over():
        return
    flexible = [
        name
        for name, term in term_library().items()
        if term.flexible and (library is None or name in library)
    ]
    if add_flexible(fitter, found, flexible, null, progress):
        grids = Grids(library, fitter.rows.count / fitter.rows.rate)
        add_further(fitter, found, grids, null, progress)
        in_parallel(lambda effect: try_without(fitter, found.final, effect, null), found.effects)
        _score(fitter, found, grids, null, progress)


def may_be_completed(fitter: Fitter, found: Found) -> bool:
    """Say whether a recording needs so many terms that no equation is exact, and is long enough to
    tell what corrects them.

    Parameters
    ----------
    fitter
        Of the recording.
    found
        What the last search found in it.
    """
    return found.needs_many_terms and _is_long(fitter)


def _is_long(fitter: Fitter) -> bool:
    """Say whether a recording is long enough to tell what holds in other ones of its subject."""
    return fitter.rows.count / fitter.rows.rate >= SHORTEST_COMPLETED_S


def choose_anew(
    fitter: Fitter,
    found: Found,
    null: Null,
    library: Sequence[str] | None = None,
    progress: Progress = lambda _: None,
) -> Found:
    """Return what was found with terms that were chosen anew, weighed and scored as a search's
    result is; what was found where none are better.

    In a recording that is long enough all of the subject is found anew first. A model that leads to
    a better one may be worse on unseen plain torque, until the refinements that make it so are
    removed in the end.

    Parameters
    ----------
    fitter, null, library, progress
        As `search` takes them.
    found
        The search's result.
    """
    if time_is_over():
        return found
    grids = Grids(library, fitter.rows.count / fitter.rows.rate)
    yardstick = fitter.rows.gain()
    hypotheses = Hypotheses(fitter, found.base, null, grids, yardstick, progress)

    def ended(best: Hypothesis) -> Found:
        _settle(fitter, found.base, best, null, yardstick)
        specialise(fitter, best.found, null)
        exchange(fitter, best.found, grids, null, yardstick, progress)
        _score_both(fitter, best.found, grids, null, progress)
        limit = BEHIND_RATIO * best.found.final.score
        others = (*found.other_models, found.final)
        best.found.other_models = [model for model in others if model.score < limit]
        return best.found

    other = subject_anew(hypotheses, fitter, found, grids, progress) if _is_long(fitter) else None
    if other is not None:
        start = replace(other.found, final=other.current)
        new = ended(chosen_anew(hypotheses, fitter, start, grids, progress) or other)
        if _is_better(fitter, new, found):
            return new
        progress("what was found anew of the subject is no better in the end")
    best = chosen_anew(hypotheses, fitter, found, grids, progress)
    return found if best is None else ended(best)


def _is_better(fitter: Fitter, new: Found, found: Found) -> bool:
    """Say whether a search's result has the lesser BIC, leaves a plausible joint, and predicts
    unseen plain torque no worse than it fits better.
    """
    vaf, before = new.final_held_out.vaf, found.final_held_out.vaf
    return (
        has_joint(new.final)
        and bic_change(fitter, found.final, new.final) < 0.0
        and not predicts_worse(found.final, before, new.final, vaf)
    )


def _score_both(fitter: Fitter, found: Found, grids: Grids, null: Null, progress: Progress) -> None:
    """Score the base model and the final one."""
    found.base_held_out = held_out(fitter, found.base)
    _score(fitter, found, grids, null, progress)
    found.base_reflex_stands_in = reflex_stands_in(fitter, found.base)
    found.base_score = fitter.fit(found.base.terms, found.base.values, evaluations=20).score


def _score(fitter: Fitter, found: Found, grids: Grids, null: Null, progress: Progress) -> None:
    """Score what was found on unseen data, remove refinements that do harm, and state errors."""
    progress("scoring on unseen data")
    found.final_held_out = held_out(fitter, found.final) if found.effects else found.base_held_out
    if _drop_harmful_refinements(fitter, found, progress):
        name_second_effect(fitter, found, grids, null, progress)
    found.unrefined = _unrefined(fitter, found)
    found.final = with_errors(fitter, found.final)
    found.reflex_stands_in = reflex_stands_in(fitter, found.final)


def _settle(fitter: Fitter, base: Fit, best: Hypothesis, null: Null, yardstick: np.ndarray) -> None:
    """Fit the hypothesis to the end, and settle what its alignment is."""
    found = best.found
    current = with_turning(
        fitter,
        fitter.fit(best.current.terms, best.current.values, evaluations=15, tolerance=1e-5),
    )
    _settle_alignment(fitter, found, current, null, yardstick)
    found.final = current
    if is_alignment(fitter, current):
        # Otherwise what alignment alone gains would count as mismatch.
        found.base = fitter.fit(
            with_term(base.terms, ALIGNMENT),
            {**base.values, ALIGNMENT: current.values[ALIGNMENT]},
            evaluations=20,
        )


def _unrefined(fitter: Fitter, found: Found) -> Fit | None:
    """Return the final model without its refinements; None where it has none."""
    if not found.refinements:
        return None
    names: Sequence[str] = found.final.terms
    for effect in found.refinements:
        names = without_term(names, effect.trial.name)
    return fitter.fit(names, found.final.values, evaluations=20)


def _drop_harmful_refinements(fitter: Fitter, found: Found, progress: Progress) -> bool:
    """Remove refinements that do harm, and return whether there were any and effects are left.

    A compliant coupling that ends at a bound of its range goes where it takes off little, also of
    what is left beside all other terms: a strap that no foot wears would take K and I of the joint
    with it. A refinement goes, too, that lets unseen plain torque be predicted worse by a larger
    factor than it lowers the whitened error: a drift that a half of the recording seems to show,
    and that the other half does not continue. The last one goes first as long as the model predicts
    unseen data worse than the base model does: fitted to a half of the recording, one of them runs
    away.
    """
    before = len(found.refinements)
    for effect in list(found.refinements):
        name = effect.trial.name
        if place_of(name) is Place.COUPLING and ends_at_bound(found.final, name):
            without = _fit_without(fitter, found, effect)
            if 1.0 - found.final.score / without.score < REFINEMENT:
                progress(f"{name} corrects little and ended at the bound of its range")
                found.refinements.remove(effect)
                found.final, found.final_held_out = without, held_out(fitter, without)
    suspects = list(found.refinements)
    while harmful := _harmful(fitter, found, suspects):
        worst = harmful.pop(0)
        progress(f"{worst.effect.trial.name} lets unseen data be predicted worse than it helps")
        found.refinements.remove(worst.effect)
        found.final, found.final_held_out = worst.fit, worst.scored
        # Without it, others of these may be useful; one that was useful beside it still is.
        suspects = [without.effect for without in harmful]
    while found.refinements and found.final_held_out.vaf < found.base_held_out.vaf:
        progress(f"{found.refinements[-1].trial.name} lets unseen data be predicted worse")
        _drop_refinement(fitter, found, found.refinements[-1])
    if found.final.score > found.base.score:
        progress("what is left explains less than the base model")
        found.effects, found.refinements = [], []
        found.final, found.final_held_out = found.base, found.base_held_out
        return False
    return len(found.refinements) < before


@dataclass(frozen=True)
class _Without:
    """Holds the final model without one of its refinements, its score on unseen data, and the
    factor by which the refinement raises what it leaves there.
    """

    effect: Effect
    fit: Fit
    scored: HeldOut
    harm: float


def _harmful(fitter: Fitter, found: Found, suspects: Sequence[Effect]) -> list[_Without]:
    """Return the model without each of some refinements whose harm is larger than their use; the
    one that predicts unseen plain torque best comes first.
    """

    def without(effect: Effect) -> _Without:
        fit = _fit_without(fitter, found, effect)
        scored = held_out(fitter, fit)
        harm = (100.0 - found.final_held_out.vaf) / (100.0 - scored.vaf)
        return _Without(effect, fit, scored, harm)

    tried = sorted(in_parallel(without, suspects), key=lambda one: -one.harm)
    return [one for one in tried if one.harm > one.fit.score / found.final.score]


def _drop_refinement(fitter: Fitter, found: Found, effect: Effect) -> None:
    """Refit the final model without one of its refinements, and score it."""
    found.refinements.remove(effect)
    found.final = _fit_without(fitter, found, effect)
    found.final_held_out = held_out(fitter, found.final)


def _fit_without(fitter: Fitter, found: Found, effect: Effect) -> Fit:
    """Refit the final model without one of its terms."""
    terms = without_term(found.final.terms, effect.trial.name)
    return fitter.fit(terms, found.final.values, evaluations=20)


def _settle_alignment(
    fitter: Fitter, found: Found, current: Fit, null: Null, yardstick: np.ndarray
) -> None:
    """Name an alignment a skew between the channels where it became one, and vice versa.

    A skew that a calibrated rig states is known and no effect.
    """
    if ALIGNMENT in fitter.held:
        return
    if is_alignment(fitter, current):
        found.effects = [effect for effect in found.effects if effect.trial.name != ALIGNMENT]
    elif ALIGNMENT in current.terms and all(
        effect.trial.name != ALIGNMENT for effect in found.effects
    ):
        without = fitter.fit(
            [t for t in current.terms if t != ALIGNMENT], current.values, evaluations=15
        )
        gains = halves_gain(halves_errors(fitter, without), halves_errors(fitter, current))
        trial = Trial(
            ALIGNMENT,
            current,
            1.0 - current.score / without.score,
            gains,
            bic_change(fitter, without, current),
        )
        trial = judged(fitter, without, trial, null.threshold(ALIGNMENT))
        if trial.accepted:
            found.effects.append(Effect(trial, fixed_errors(current, yardstick)))
