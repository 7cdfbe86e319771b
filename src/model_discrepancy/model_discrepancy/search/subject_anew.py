"""What belongs to the subject is found anew, beside what belongs to the rig and a kind of straps.

A search sees the joint through the straps. Where it took wrong ones first, or a mode of the sensor
in their place, all that it found of the joint and its reflexes fits what is wrong there. No
exchange of one term, or of one kind of terms, finds back from that: in a recording of a person the
last digits of its numbers decided which way a search took. What belongs to the rig depends on the
straps least. So it stays, and a search for all others begins anew from each kind of straps.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ankle_physics.term import Owner, term_library
from model_discrepancy.fit.base_model import bic_change
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.parallel import in_parallel
from model_discrepancy.search.candidates import begun_anew
from model_discrepancy.search.chosen_anew import BARE_EVALUATIONS, EVALUATIONS, LOAD_PATH
from model_discrepancy.search.found import Effect, Found, Progress, Trial, is_usual
from model_discrepancy.search.grids import Grids
from model_discrepancy.search.hypotheses import BEHIND_RATIO, Hypotheses
from model_discrepancy.search.hypothesis import Hypothesis
from model_discrepancy.search.screening import with_term
from model_discrepancy.search.shared_families import bare_of
from model_discrepancy.search.trials import fixed_errors

# Evaluations of each model that tells what an effect takes off beside those before it.
ORDER_EVALUATIONS = 15


def subject_anew(
    hypotheses: Hypotheses,
    fitter: Fitter,
    found: Found,
    grids: Grids,
    progress: Progress,
) -> Hypothesis | None:
    """Return the hypothesis of the least BIC that begins with what was found of the rig and one
    kind of straps; None where none of them holds other terms and has a lesser BIC than what was
    found, or nothing was found of the subject.

    Straps that are well behind other ones from the first are not followed.

    Parameters
    ----------
    hypotheses
        Adds terms.
    fitter
        Whitened by the recording's noise.
    found
        With the final model.
    grids
        Of the library that may be named.
    progress
        Called with one line for each kind of straps.
    """
    final, effects = found.final, [*found.effects, *found.refinements]
    kept = [effect for effect in effects if _is_of_the_rig(effect.trial.name)]
    gone = [effect for effect in effects if effect not in kept]
    if not gone:
        return None
    bare = bare_of(fitter, final, [effect.trial.name for effect in gone], BARE_EVALUATIONS)
    beside = {term: final.values[term] for term in bare.terms}
    # What was first found of the subject stood for the straps, or for what is seen through them.
    place = effects.index(gone[0])

    def begun(name: str) -> Trial:
        progress(f"{name} anew, in the place of all of the subject")
        return begun_anew(fitter, bare, name, grids.whole(name), EVALUATIONS, beside)

    def followed(straps: Trial) -> Hypothesis:
        trials = [effect.trial for effect in kept]
        trials.insert(place, straps)
        ordered = _in_order(fitter, found.base, straps.fit, trials)
        return hypotheses.followed(Found(found.base, straps.fit, ordered), alone=straps.name)

    tried = in_parallel(begun, [name for name in _straps(grids) if name not in bare.terms])
    limit = BEHIND_RATIO * min((straps.fit.score for straps in tried), default=0.0)
    others = [
        other
        for other in in_parallel(followed, [one for one in tried if one.fit.score < limit])
        if other.plausible and set(other.current.terms) != set(final.terms)
    ]
    changes = [bic_change(fitter, final, other.current) for other in others]
    return others[int(np.argmin(changes))] if changes and min(changes) < 0.0 else None


def _in_order(fitter: Fitter, base: Fit, current: Fit, trials: Sequence[Trial]) -> list[Effect]:
    """Return effects with the errors that are left when each is added beside those before it."""
    yardstick, effects = fitter.rows.gain(), []
    terms: Sequence[str] = base.terms
    for trial in trials:
        terms = with_term(terms, trial.name)
        fit = fitter.fit(terms, current.values, evaluations=ORDER_EVALUATIONS)
        effects.append(Effect(trial, fixed_errors(fit, yardstick)))
    return effects


def _is_of_the_rig(name: str) -> bool:
    """Say whether a term belongs to the rig and stands in for no straps."""
    term = term_library()[name]
    return term.belongs_to is Owner.RIG and term.family not in LOAD_PATH


def _straps(grids: Grids) -> list[str]:
    """Return the kinds of straps that may be begun: what is usual between plate and foot."""
    return [
        name
        for name, term in term_library().items()
        if is_usual(name) and term.family in LOAD_PATH and grids.allows(name)
    ]
