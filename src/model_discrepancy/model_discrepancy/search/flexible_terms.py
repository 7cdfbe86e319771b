"""Terms that take many shapes are tried after the search, where no equation is exact.

Beside a few named effects such a term would stand in for another one. Where a recording needs more
terms, as those of real people and rigs do, each of their equations is a little wrong, and a term
that follows the shape of the largest of these errors predicts unseen data better. Once it does,
further terms of the library show that were hidden behind these errors.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ankle_physics.term import Term, term_library
from model_discrepancy.fit.base_model import bic_change
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.least_squares import orthonormal
from model_discrepancy.fit.parallel import in_parallel
from model_discrepancy.search.candidates import Candidates
from model_discrepancy.search.found import Effect, Found, Progress, Trial
from model_discrepancy.search.grids import Grids
from model_discrepancy.search.harm import harms
from model_discrepancy.search.null import Null, exceeded_by_chance
from model_discrepancy.search.screening import with_term, without_term
from model_discrepancy.search.trials import fixed_errors, judged

# Of the whitened error, on the unseen rows of either half. On two human trials those that were
# worth it took off 6 to 20 %, the others 2 % at most in the half that gained less.
LEAST_GAIN = 0.03
# Of a fit that begins without the shape: it converges within twenty.
EVALUATIONS = 30
# The same of a term of the library beside them, which has fewer parameters. On one of two human
# trials two of them took off 7 % each, on the other none did.
LEAST_FURTHER_GAIN = 0.02
MOST_FURTHER = 3


def add_flexible(
    fitter: Fitter,
    found: Found,
    names: list[str],
    null: Null,
    progress: Progress,
) -> bool:
    """Add each flexible term that predicts unseen data better; it takes the place of its special
    cases. Return whether any was added.

    Parameters
    ----------
    fitter, null
        Of the recording, as the search had them.
    found
        With the final model; changed.
    names
        Flexible terms that may be named.
    progress
        Called with one line for each term.
    """
    before, left = found.final, list(names)
    added = True
    # Beside one of them another one may be worth it that was not before.
    while added:
        added = False
        for name in list(left):
            if _added(fitter, found, name, null, progress):
                left.remove(name)
                added = True
    if found.final is before:
        return False
    found.inflexible = before
    return True


def add_further(fitter: Fitter, found: Found, grids: Grids, null: Null, progress: Progress) -> None:
    """Add terms of the library that predict unseen data better beside the flexible ones.

    Parameters
    ----------
    fitter, found, null
        As `add_flexible` takes them.
    grids
        Of the library that may be named.
    progress
        Called with one line for each step.
    """
    candidates = Candidates(fitter, null, grids, progress)
    for _ in range(MOST_FURTHER):
        progress("looking for a further term")
        trials, _ = candidates.best(found.final)
        good = [t for t in trials if _corrects(t, LEAST_FURTHER_GAIN)]
        if not good:
            break
        best = max(good, key=lambda trial: min(trial.held_out))
        fit = fitter.fit(best.fit.terms, best.fit.values, evaluations=15)
        if harms(fitter, found.final, fit):
            break
        progress(f"{best.name} takes off {100 * best.gain:.0f} % of the error")
        found.refinements.append(Effect(best, fixed_errors(fit, fitter.rows.gain())))
        found.final = fit


def _corrects(trial: Trial, least: float) -> bool:
    """Say whether a term corrects the shape of the model: it takes off this share at least on
    unseen rows, and is accepted however little torque it changes.
    """
    return min(trial.held_out) > least and replace(trial, torque_share=1.0).accepted


def _added(fitter: Fitter, found: Found, name: str, null: Null, progress: Progress) -> bool:
    """Add a flexible term where it predicts unseen data better, and return whether it does."""
    term = term_library()[name]
    progress(f"trying {name}, which takes many shapes")
    if not _promises(fitter, found.final, term):
        return False
    trial = _tried(fitter, found.final, term, null)
    if not _corrects(trial, LEAST_GAIN) or harms(fitter, found.final, trial.fit):
        return False
    progress(f"{name} takes off {100 * trial.gain:.0f} % of the error")
    _add(fitter, found, term, trial)
    return True


def _promises(fitter: Fitter, final: Fit, term: type[Term]) -> bool:
    """Say whether a term may take off enough to be worth the time of a fit, as far as the model is
    linear in its parameters. A term that begins with another value than 0 is fitted anyway.
    """
    own = [parameter for parameter in term.parameters if parameter.fitted]
    if any(parameter.default != 0.0 for parameter in own):
        return True
    values = fitter.start_values([*final.terms, term.name], final.values)
    spectra = fitter.columns.spectra(values)
    amplitudes = {(n, symbol): values[n][symbol] for n, symbol in spectra}
    slopes = in_parallel(
        lambda parameter: fitter.slope(values, term.name, parameter, amplitudes, spectra), own
    )
    used = fitter.rows.fitted
    basis = orthonormal(fitter.derivatives(final)[0][used])
    columns = np.column_stack(slopes)[used]
    span = orthonormal(columns - basis @ (basis.T @ columns))
    promised = float(np.sum((span.T @ final.residual[used]) ** 2))
    return promised > LEAST_GAIN * final.score


def _tried(fitter: Fitter, final: Fit, term: type[Term], null: Null) -> Trial:
    """Return the trial of the final model with a flexible term in the place of its special
    cases.
    """
    terms, start = list(final.terms), dict(final.values)
    known: dict[str, float] = {}
    for special in term.generalises:
        if special in terms:
            terms = without_term(terms, special)
            known |= start.pop(special)
    symbols = {parameter.symbol for parameter in term.parameters}
    own = fitter.start_values([term.name])[term.name]
    start[term.name] = own | {s: value for s, value in known.items() if s in symbols}
    fit = fitter.fit(with_term(terms, term.name), start, evaluations=EVALUATIONS)
    by_chance = _gain_by_chance(fitter, fit, term.name, null)
    gain = 1.0 - fit.score / final.score
    trial = Trial(term.name, fit, gain, (0.0, 0.0), bic_change(fitter, final, fit))
    return judged(fitter, final, trial, by_chance)


def _gain_by_chance(fitter: Fitter, fit: Fit, name: str, null: Null) -> float:
    """Return the gain that a term exceeds by chance, with all of its parameters at once and beside
    the other terms. It stands alone: no library competes with it.
    """
    derivatives, labels = fitter.derivatives(fit)
    used = fitter.rows.fitted
    own = np.array([term == name for term, _ in labels])
    basis = orthonormal(derivatives[used][:, ~own])
    columns = derivatives[used][:, own]
    columns = columns - basis @ (basis.T @ columns)
    null.observe(name, orthonormal(columns))
    return exceeded_by_chance(null.gains[name]) if name in null.gains else 1.0


def _add(fitter: Fitter, found: Found, term: type[Term], trial: Trial) -> None:
    """Put a term in the place of the first of its special cases, or among the refinements."""
    found.final = trial.fit
    new = Effect(trial, fixed_errors(trial.fit, fitter.rows.gain()))
    for effects in (found.effects, found.refinements):
        places = [k for k, e in enumerate(effects) if e.trial.name in term.generalises]
        if places:
            old = effects[places[0]]
            new.rivals, new.excluded = old.rivals, old.excluded
            effects[places[0]] = new
            return
    found.refinements.append(new)
