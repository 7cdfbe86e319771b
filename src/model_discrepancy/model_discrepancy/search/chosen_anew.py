"""Terms that stand in for each other are chosen anew, beside everything that was found meanwhile.

What was found first was found while all else was missing. In a recording of a person, with ten
terms and more, a soft strap with an appendage of the plate may stand where a stiff strap belongs,
and what was found later fits what is wrong there. Neither one exchange of terms nor a fit finds
back from that. So all terms of such a kind are removed, each of them is begun anew from its whole
grid beside the others, and the search goes on from there (a search in large neighbourhoods; Shaw,
Lect. Notes Comput. Sci. 1520 (1998) 417-431).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from ankle_physics.term import term_library
from model_discrepancy.fit.base_model import bic_change
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.search.candidates import begun_anew
from model_discrepancy.search.found import Effect, Found, Progress
from model_discrepancy.search.grids import Grids
from model_discrepancy.search.harm import harms
from model_discrepancy.search.hypotheses import Hypotheses
from model_discrepancy.search.hypothesis import Hypothesis
from model_discrepancy.search.shared_families import bare_of
from model_discrepancy.search.time_limit import time_is_over

# Families of what carries the load between joint and sensor, or swings beside it.
LOAD_PATH = ("resonance in the load path", "resonance beside the load path")
# Families whose terms stand in for each other and take off most, so that a wrong one bends the
# others. The path of the load comes first: what the joint does is seen through it.
KINDS = (LOAD_PATH, ("intrinsic memory", "nonlinear damping"))
# Evaluations of a term that is begun anew, beside the others as they were.
EVALUATIONS = 25
# The same of the model without what is chosen anew: it only tells where the others may begin.
BARE_EVALUATIONS = 10
# A term that leaves more than this ratio of the error, before others are added, is given up. In
# three recordings of people those that led to a better model left 1.02 to 1.31 of it.
FAR_RATIO = 1.35


def chosen_anew(
    hypotheses: Hypotheses,
    fitter: Fitter,
    found: Found,
    grids: Grids,
    progress: Progress,
) -> Hypothesis | None:
    """Return the hypothesis with other terms of some kind, and what is worth adding beside them;
    None where no such one is better.

    It is better where its BIC is less, the joint keeps a plausible inertia, and unseen plain torque
    is not predicted worse than it fits better.

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
        Called with one line for each term that is begun.
    """
    best, now = None, found
    for kind in KINDS:
        bare = None
        for name in _names(kind, grids):
            gone = _of_kind(now, kind)
            if not gone or [effect.trial.name for effect in gone] == [name]:
                continue
            if time_is_over():
                return best
            # The same for every term that is begun, until one leads to a better model.
            bare = bare or bare_of(
                fitter, now.final, [e.trial.name for e in gone], BARE_EVALUATIONS
            )
            begun = _beginning_with(fitter, now, gone, bare, name, grids, progress)
            if begun is None:
                continue
            other = hypotheses.followed(begun)
            if other.plausible and _better(fitter, now.final, other.current):
                taken = ", ".join(effect.trial.name for effect in other.found.effects)
                progress(f"{name}, chosen anew, leads to a better model: {taken}")
                best, now, bare = other, replace(other.found, final=other.current), None
    return best


def _of_kind(found: Found, kind: Sequence[str]) -> list[Effect]:
    """Return the effects and refinements of some families."""
    library, effects = term_library(), (*found.effects, *found.refinements)
    return [effect for effect in effects if library[effect.trial.name].family in kind]


def _names(kind: Sequence[str], grids: Grids) -> list[str]:
    """Return the terms of some families that may be begun."""
    return [
        name
        for name, term in term_library().items()
        if term.family in kind and term.searched and not term.flexible and grids.allows(name)
    ]


def _beginning_with(
    fitter: Fitter,
    found: Found,
    gone: Sequence[Effect],
    bare: Fit,
    name: str,
    grids: Grids,
    progress: Progress,
) -> Found | None:
    """Return what was found with one term, begun anew, in the place of all terms of its kind; None
    where a known rig or the base model holds it, it leads nowhere, or the others run away alone.
    """
    if name in bare.terms or not math.isfinite(bare.score):
        return None
    progress(f"{name} anew, in the place of {', '.join(e.trial.name for e in gone)}")
    final, effects = found.final, [*found.effects, *found.refinements]
    # The others as they are beside these: without them, they stand in for a part of them.
    others = {term: final.values[term] for term in bare.terms}
    limit = FAR_RATIO * final.score
    trial = begun_anew(fitter, bare, name, grids.whole(name), EVALUATIONS, others, limit)
    if trial.fit.score > limit:
        return None
    place = effects.index(gone[0])
    kept = [effect for effect in effects if effect not in gone]
    kept.insert(place, Effect(trial, gone[0].errors))
    return Found(found.base, trial.fit, effects=kept)


def _better(fitter: Fitter, final: Fit, other: Fit) -> bool:
    """Say whether another model is to be preferred to the present one."""
    return bic_change(fitter, final, other) < 0.0 and not harms(fitter, final, other)
