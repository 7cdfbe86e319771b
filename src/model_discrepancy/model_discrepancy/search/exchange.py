"""The effects of a search are weighed, and a rival that fits better takes an effect's place."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ankle_physics.term import term_library
from model_discrepancy.fit.base_model import bic_change
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import MATERIAL_SHARE, Fitter
from model_discrepancy.fit.parallel import in_parallel
from model_discrepancy.search.found import REFINEMENT, Effect, Found, Progress, Trial, place_of
from model_discrepancy.search.grids import Grids
from model_discrepancy.search.harm import harms
from model_discrepancy.search.null import Null
from model_discrepancy.search.one_for_two import one_for_two
from model_discrepancy.search.screening import Screened, screen, without_term
from model_discrepancy.search.time_limit import time_is_over
from model_discrepancy.search.trials import (
    drop_superfluous,
    fixed_errors,
    judged,
    preceding_gain,
    refitted,
)

# A rival is excluded when it leaves this much more whitened error than the best one.
RIVAL_EXCESS = 0.03
# Excess of whitened error at which a rival's odds fall to 1/e: a third of the excess that excludes
# it.
ODDS_SCALE = RIVAL_EXCESS / 3.0
# The screening is linear: a rival may do somewhat better after its refit than it promised.
RIVAL_PROMISE = 0.6
RIVALS_REFITTED = 3
# Of a rival's fit, whose other values have to follow a long way: straps, with the plate's inertia
# beside them, were 3 % from their end after eight.
RIVAL_EVALUATIONS = 40
# A rival takes an effect's place where it lowers the whitened error by this share with no more
# parameters; a term that was found early may only have stood in for it.
SWAP_GAIN = 0.005
# With more parameters it must lower it by this share: they bend an equation towards the right one,
# and what only corrected a shape took off at most so much (see `SECOND_EFFECT_GAIN`).
LARGER_SWAP_GAIN = 0.1
MOST_SWAPS = 3
# Share of the whitened error that the others leave, fitted and on unseen rows. A refinement of a
# model is an effect of its own where it alone takes off so much, changes torque that matters and
# has no value at a bound. Of 32 development recordings on the independent rig the second of two
# effects took off 0.16 to 0.47 so; what only corrected a shape came with others that took off as
# much, or took off at most 0.10.
SECOND_EFFECT_GAIN = 0.13
# More refinements than these correct the shape of a model that is not the right one.
MOST_REFINEMENTS = 3


def _weigh(fitter: Fitter, found: Found, null: Null, before: np.ndarray) -> None:
    """Measure each effect and mark refinements.

    These lower the mismatch by next to nothing, or move next to no torque. One of them may still be
    an effect beside a larger one.
    """
    final = found.final
    whole = np.abs(before - found.effects[-1].errors)
    effects, found.effects = found.effects, []
    for effect in effects:
        small = bool(np.all(before - effect.errors < REFINEMENT * whole))
        before = np.minimum(before, effect.errors)
        (found.refinements if small else found.effects).append(effect)
    in_parallel(lambda effect: try_without(fitter, final, effect, null), found.effects)
    _name_second_effect(fitter, found, null)


def _name_second_effect(fitter: Fitter, found: Found, null: Null) -> Effect | None:
    """Make the one refinement that is an effect beside the larger ones an effect, and return it;
    None where there is no such one, or more than one takes off as much.
    """
    if not found.effects or not 1 <= len(found.refinements) <= MOST_REFINEMENTS:
        return None
    final = found.final
    in_parallel(lambda effect: try_without(fitter, final, effect, null), found.refinements)
    refinements = {effect.trial.name: effect for effect in found.refinements}
    named = [effect.trial.name for effect in found.effects]
    name = second_effect(final, [e.trial for e in refinements.values()], named)
    if name is None:
        return None
    found.refinements.remove(refinements[name])
    found.effects.append(refinements[name])
    return refinements[name]


def try_without(fitter: Fitter, final: Fit, effect: Effect, null: Null) -> None:
    """Measure what the final model loses without an effect.

    Parameters
    ----------
    fitter
        Whitened by the recording's noise.
    final
        The model.
    effect
        Of this model; changed.
    null
        What each term gains by chance.
    """
    name = effect.trial.name
    effect.without = fitter.fit(without_term(final.terms, name), final.values, evaluations=15)
    gain = 1.0 - final.score / effect.without.score
    trial = replace(
        effect.trial, fit=final, gain=gain, bic=bic_change(fitter, effect.without, final)
    )
    effect.trial = judged(fitter, effect.without, trial, null.threshold_of(name, final))


def second_effect(final: Fit, refinements: Sequence[Trial], named: Sequence[str]) -> str | None:
    """Return which refinement of a model is an effect beside the larger ones, or None.

    Parameters
    ----------
    final
        Model with all effects and refinements.
    refinements
        Each judged against the model without it.
    named
        Terms of the larger effects; a refinement of their families corrects their shape.
    """
    large = [t for t in refinements if min(t.gain, *t.held_out) > SECOND_EFFECT_GAIN]
    if len(large) != 1:
        return None
    (only,) = large
    library = term_library()
    families = {library[name].family for name in named}
    is_second = (
        only.accepted
        and only.torque_share > MATERIAL_SHARE
        and not ends_at_bound(final, only.name)
        and library[only.name].family not in families
    )
    return only.name if is_second else None


def _rivals(
    fitter: Fitter, found: Found, effect: Effect, grids: Grids, null: Null, progress: Progress
) -> None:
    """Find which other terms would do as well as an effect."""
    final = found.final
    name, without = effect.trial.name, effect.without
    progress(f"looking for rivals of {name}")
    points = {
        other: tried
        for other, tried in grids.best(without).items()
        if other != name and name not in term_library()[other].generalises
    }
    screened = screen(fitter, without, points)

    def is_simpler_sibling(other: str) -> bool:
        return _is_simpler(other, name) and place_of(other) is place_of(name)

    # The screening says least about a simple term beside ones that were fitted without it.
    promising = [
        s
        for s in screened
        if s.share > RIVAL_PROMISE * effect.trial.gain or is_simpler_sibling(s.name)
    ]
    tried = [
        s for rank, s in enumerate(promising) if rank < RIVALS_REFITTED or _is_simpler(s.name, name)
    ]
    limit = (1.0 + RIVAL_EXCESS) * final.score
    # Such an effect stands in for another one: what acts at its place with no more parameters is
    # fitted to the end, wherever that seems to lead.
    stands_in = ends_at_bound(final, name)

    imitated = term_library()[name].imitated_by(final.values)

    def in_its_place(s: Screened) -> Trial:
        # The others as they are beside the effect: without it, they stand in for a part of it.
        start = {
            **without.values,
            **final.values,
            s.name: s.start,
            **imitated.get(s.name, {}),
        }
        below = math.inf if stands_in and is_simpler_sibling(s.name) else limit
        return refitted(fitter, without, s.name, start, RIVAL_EVALUATIONS, below)

    trials = in_parallel(in_its_place, tried)
    near = [
        replace(
            t,
            by_chance=null.threshold_of(t.name, t.fit),
            preceding_gain=preceding_gain(fitter, t),
        )
        for t in trials
        if t.fit.score < limit
    ]
    effect.rivals = sorted((t for t in near if not t.unconfirmed), key=lambda t: -t.gain)
    effect.excluded = _excluded(effect, final, trials, screened) | {
        t.name: "what the muscles held before the movements does not confirm it"
        for t in near
        if t.unconfirmed
    }


def _is_simpler(name: str, other: str) -> bool:
    """Return whether a term has no more parameters than the other one.

    General terms promise as much as a simple one and would crowd it out.
    """
    library = term_library()

    def size(term: str) -> int:
        parts = (term, *library[term].companions)
        return sum(p.fitted for part in parts for p in library[part].parameters)

    return size(name) <= size(other)


def _excluded(
    effect: Effect, final: Fit, trials: Sequence[Trial], screened: Sequence[Screened]
) -> dict[str, str]:
    """Return why terms that were refitted, and siblings that were not, would not do instead."""
    library = term_library()
    name, kept = effect.trial.name, {t.name for t in effect.rivals}
    reasons = {
        t.name: f"refitted in its place it leaves {100 * (t.fit.score / final.score - 1.0):.0f} % "
        "more error"
        for t in trials
        if t.name not in kept
    }
    refitted = {t.name for t in trials}
    family = library[name].family
    for s in screened:
        if family and library[s.name].family == family and s.name not in refitted:
            reasons[s.name] = (
                f"it takes off at most {100 * max(s.share, 0.0):.0f} % of the error where "
                f"{name.replace('_', ' ')} takes off {100 * effect.trial.gain:.0f} %"
            )
    return reasons


def specialise(fitter: Fitter, found: Found, null: Null) -> None:
    """Put the special case of a general term in its place, where the general one takes off no more
    than by chance beyond it: beside the terms that were found later it may not be needed.

    Parameters
    ----------
    fitter
        Whitened by the recording's noise.
    found
        With the final model; changed.
    null
        What each term gains by chance.
    """
    library = term_library()
    for effect in found.effects:
        general, final = effect.trial, found.final
        for name in library[general.name].generalises:
            symbols = [parameter.symbol for parameter in library[name].parameters]
            values = final.values[general.name]
            if not set(symbols) <= set(values):
                continue
            terms = [name if term == general.name else term for term in final.terms]
            start = {**final.values, name: {symbol: values[symbol] for symbol in symbols}}
            special = fitter.fit(terms, start, evaluations=15)
            if 1.0 - final.score / special.score < null.threshold_of(general.name, final):
                effect.trial = replace(general, name=name, fit=special)
                found.final = special
                break


def exchange(
    fitter: Fitter,
    found: Found,
    grids: Grids,
    null: Null,
    yardstick: np.ndarray,
    progress: Progress,
) -> bool:
    """Weigh the effects and find their rivals; one that fits better takes the effect's place, and
    one that makes another term superfluous takes the place of both. Return whether any did.
    """
    swaps = 0
    while found.effects:
        _weigh(fitter, found, null, fixed_errors(found.base, yardstick))
        for effect in found.refinements:
            effect.rivals = []
        in_parallel(
            lambda effect: _rivals(fitter, found, effect, grids, null, progress),
            [*found.effects, *_ending_at_bounds(fitter, found, null)],
        )
        if swaps == MOST_SWAPS or time_is_over():
            break
        options = better_rivals(found)
        better = next((o for o in options if not harms(fitter, found.final, o[1].fit)), None)
        better = better or one_for_two(fitter, found, null, progress)
        if better is None:
            break
        _swap(fitter, found, *better, null, yardstick, progress)
        swaps += 1
    return swaps > 0


def _ending_at_bounds(fitter: Fitter, found: Found, null: Null) -> list[Effect]:
    """Return the refinements of a model of few terms that end at the bound of a range, measured: a
    resonance whose damping does so is a lag, and the lag may be an effect.
    """
    if len(found.refinements) > MOST_REFINEMENTS:
        return []
    ending = [
        effect for effect in found.refinements if ends_at_bound(found.final, effect.trial.name)
    ]
    in_parallel(lambda effect: try_without(fitter, found.final, effect, null), ending)
    return ending


def ends_at_bound(final: Fit, name: str) -> bool:
    """Say whether a term of a model ends at the bound of a range.

    Parameters
    ----------
    final
        The model.
    name
        Of the term.
    """
    return any(label.startswith(f"{name}.") for label in final.at_bounds)


def better_rivals(found: Found) -> list[tuple[Effect, Trial]]:
    """Return effects and their rivals that fit better with no more parameters, the best rival
    first.

    A rival that takes off no more than by chance, such as a term that follows slow torque where
    the reflex varies, takes no place.

    Parameters
    ----------
    found
        With the rivals of each effect, and of refinements that end at the bound of a range.
    """
    final = found.final
    options = [
        (effect, rival)
        for effect in (*found.effects, *found.refinements)
        for rival in effect.rivals
        if rival.exceeds_chance
        and rival.fit.score < (1.0 - _least_gain(rival, final)) * final.score
    ]
    return sorted(options, key=lambda option: option[1].fit.score)


def _least_gain(rival: Trial, final: Fit) -> float:
    """Return by which share a rival must lower the error to take a place."""
    if rival.fit.size <= final.size:
        return SWAP_GAIN
    return max(LARGER_SWAP_GAIN, rival.by_chance)


def _swap(
    fitter: Fitter,
    found: Found,
    effect: Effect,
    rival: Trial,
    null: Null,
    yardstick: np.ndarray,
    progress: Progress,
) -> None:
    """Put a rival in an effect's place; what it makes superfluous is removed."""
    progress(f"{rival.name} takes the place of {effect.trial.name}")
    current = fitter.fit(rival.fit.terms, rival.fit.values, evaluations=15)
    # In its place in the order, too: at the end it would seem to take off next to nothing.
    taken = Effect(rival, effect.errors)
    if effect in found.effects:
        found.effects[found.effects.index(effect)] = taken
    else:
        found.refinements.remove(effect)
        found.effects.append(taken)
    found.effects[-1].errors = fixed_errors(current, yardstick)
    found.final = drop_superfluous(fitter, found, taken, current, null, progress)


def name_second_effect(
    fitter: Fitter, found: Found, grids: Grids, null: Null, progress: Progress
) -> None:
    """Name the one refinement that is an effect of its own, and find its rivals; nothing is done
    where there is no such one.
    """
    second = _name_second_effect(fitter, found, null)
    if second is not None:
        _rivals(fitter, found, second, grids, null, progress)
