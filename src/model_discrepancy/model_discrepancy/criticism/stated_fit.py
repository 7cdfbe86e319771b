"""The values that are stated of a model which does not explain everything.

A fit to the whitened torque is the best one where the model is right: it trusts every frequency as
far as its noise allows. Where something is missing, it trusts most the small fast torque, in which
the lack of the model is far above the noise, and gives up values that the large torque of the
movements shows. In human trials the two halves of a trial then disagree in K and G. So the values
of a model that leaves much predictable follow from the plain torque, as its VAF does. So do those
of a model with flexible terms, which stand for equations that are not exact.
"""

from __future__ import annotations

from ankle_physics.term import term_library
from model_discrepancy.criticism.remainder import Remainder
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.standard_errors import with_errors

# Of the whitened residual, predictable on unseen rows. The base model was fitted to recordings of
# an independent rig: where less is predictable, K was off by 1 % (plain fit: 3 %), and where more
# is, by 11 % (plain fit: 4 %); medians of docs/results/weighting.md.
LEAST_SHARE = 0.1
# Plain and whitened fits of one model lie near each other; five more than a whitened refit takes.
_EVALUATIONS = 25


def stated_fit(fitter: Fitter, fit: Fit, after: Remainder) -> Fit:
    """Return a model with the values that are stated of it.

    Parameters
    ----------
    fitter
        With the whitening of the search.
    fit
        The model as the search fitted it, to the whitened torque.
    after
        What the augmented model leaves predictable.

    Returns
    -------
    Fit
        The same where little is missing and no term is flexible; else the model fitted to the plain
        torque, with standard errors where the given one has them.
    """
    lacks = after.exceeds_chance and after.share >= LEAST_SHARE
    if lacks or any(term_library()[name].flexible for name in fit.terms):
        return plain_fit(fitter, fit)
    return fit


def plain_fit(fitter: Fitter, fit: Fit) -> Fit:
    """Return a model fitted to the plain torque, with standard errors where the given one has them.

    Parameters
    ----------
    fitter
        With the whitening of the search.
    fit
        The model, from whose values the fit begins.
    """
    plain = fitter.unwhitened()
    refitted = plain.fit(fit.terms, fit.values, evaluations=_EVALUATIONS)
    return with_errors(plain, refitted) if fit.draws else refitted
