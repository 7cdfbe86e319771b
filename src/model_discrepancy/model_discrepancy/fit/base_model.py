"""The base model of a recording: its fit from several starts, and the alignment of its channels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ankle_physics.joint_profile import ANKLE, joint_in_force
from ankle_physics.model import PAPER_TERMS
from ankle_physics.term import ModelValues, term_library
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.parameter_scale import Start, plausible, to_unit

# The term whose smallest values say no more than how well two channels are aligned.
ALIGNMENT = "channel_skew"
# An alignment of less than half a sample is worth its parameter when BIC falls by this much.
ALIGNMENT_BIC = 50.0
# A joint whose inertia lies so low in its plausible range, 0...1 (logarithmic), has lost it to
# something else: a part that swings beside the foot, or a mode of the sensor. An adult's foot has
# four times the lower end (0.33), a child's of ten years about twice (0.16).
LEAST_INERTIA_PLACE = 0.1
# Nor is it plausible that the foot has less than this share of all that moves: the smallest foot
# of an adult (0.005 kg.m^2) on the heaviest plate (0.02 kg.m^2). In a half of a human trial a plate
# and a part beside it had taken 85 %, and the other half was not predicted.
LEAST_INERTIA_SHARE = 0.2
_OTHER_INERTIA = (("footplate_inertia", "Ip"), ("plate_appendage", "Ia"))
# Of the torque's variance: four parameters that follow noise and voluntary torque take less, and
# their delay may end anywhere. None of 809 recordings of the independent rig without a mismatch,
# each with a reflex, had one whose delay, frequency or damping ended at a bound.
LEAST_REFLEX_SHARE = 0.01
# Starts of the base fit: its delay and muscle speed have several minima.
BASE_STARTS = tuple(
    {"delay": delay, "omega": omega, "z": 0.8} for delay in (0.035, 0.05) for omega in (10.0, 21.0)
)


def fit_base(fitter: Fitter, terms: Sequence[str] = PAPER_TERMS) -> Fit:
    """Return the base model from several starts; leaves the fitter whitened by its residual."""
    best = min(
        (fitter.fit(terms, {"reflex": dict(start)}, evaluations=15) for start in BASE_STARTS),
        key=lambda fit: fit.score,
    )
    for _ in range(2):
        fitter.whiten_by(best.plain)
        starts = [best.values, *({"reflex": dict(start)} for start in BASE_STARTS[:2])]
        best = min(
            (fitter.fit(terms, start, evaluations=25) for start in starts),
            key=lambda fit: fit.score,
        )
    return best


def align(fitter: Fitter, fit: Fit) -> Fit:
    """Return the fit with its channels aligned, where they are apart by less than half a sample:
    too little to be a finding, enough to be seen.
    """
    if ALIGNMENT in fit.terms:
        return fit
    aligned = fitter.fit(
        [*fit.terms, ALIGNMENT], {**fit.values, ALIGNMENT: {"skew": 0.0}}, evaluations=10
    )
    return (
        aligned
        if is_alignment(fitter, aligned) and bic_change(fitter, fit, aligned) < -ALIGNMENT_BIC
        else fit
    )


def without_alignment(values: Start) -> ModelValues:
    """Return a model's values without those of the channels' alignment.

    Parameters
    ----------
    values
        By term and symbol.
    """
    return {term: dict(given) for term, given in values.items() if term != ALIGNMENT}


def is_alignment(fitter: Fitter, fit: Fit) -> bool:
    """Say whether the channels are apart by less than half a sample."""
    return (
        ALIGNMENT in fit.terms
        and abs(fit.values[ALIGNMENT]["skew"]) <= 0.5 * fitter.columns.motion.sample_time
    )


def has_joint(fit: Fit) -> bool:
    """Say whether a model leaves the joint a plausible inertia, by itself and beside the inertia of
    other parts; true where it has no such term.
    """
    if "inertia" not in fit.values:
        return True
    own = fit.values["inertia"]["I"]
    range_ = plausible("inertia", term_library()["inertia"].parameter("I"))
    if to_unit(range_, max(own, range_.lower)) <= LEAST_INERTIA_PLACE:
        return False
    if joint_in_force() != ANKLE:
        # A handle may be many times as heavy as a hand.
        return True
    others = sum(fit.values[term][symbol] for term, symbol in _OTHER_INERTIA if term in fit.values)
    return own >= LEAST_INERTIA_SHARE * (own + others)


def reflex_at_bound(fit: Fit) -> bool:
    """Tell whether the reflex's delay, frequency or damping ends at the bound of its range, of a
    reflex that makes torque.
    """
    bounds = set(fit.at_bounds)
    shape = {f"reflex.{p.symbol}" for p in term_library()["reflex"].parameters if not p.linear}
    return bool(bounds & shape) and "reflex.G" not in bounds


def reflex_stands_in(fitter: Fitter, fit: Fit) -> bool:
    """Tell whether the reflex stands in for another response: it ends at the bound of its range,
    and makes so much torque that no noise has led it there.
    """
    if not reflex_at_bound(fit):
        return False
    column = fitter.columns.spectra(fit.values)["reflex", "G"]
    used, gain = fitter.rows.used, fit.values["reflex"]["G"]
    torque = np.var(gain * fitter.rows.plain(column)[used])
    return bool(torque > LEAST_REFLEX_SHARE * np.var(fitter.plain_target[used]))


def bic(fitter: Fitter, fit: Fit) -> float:
    """Return the Bayesian information criterion of a fit, up to what all fits of a recording share
    (Schwarz 1978, Ann. Statist. 6, 461).

    Parameters
    ----------
    fitter
        Of the recording.
    fit
        Whitened by it.
    """
    n = fitter.rows.independent
    return n * float(np.log(fit.score)) + fit.size * float(np.log(n))


def bic_change(fitter: Fitter, old: Fit, new: Fit) -> float:
    """Return the BIC of the new fit minus that of the old one."""
    return bic(fitter, new) - bic(fitter, old)
