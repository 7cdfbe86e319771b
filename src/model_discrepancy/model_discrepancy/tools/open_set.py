"""Names that could each stand for one effect, and what recordings exclude of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from ankle_physics.term import term_library
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.search.exchange import RIVAL_EXCESS
from model_discrepancy.search.screening import with_term, without_term
from model_discrepancy.tools.experiment_design import Values

# A name that leaves more than this share of what the likeliest name takes off explains less than
# half of the effect: it is another one, however small the effect is beside all the torque.
LARGEST_LOSS = 0.5
# Share of the error that the likeliest name must take off all designed recordings for that: what
# takes off less is not shown by them.
LEAST_TAKEN = 0.005
# Log-likelihood by which it must be the less likely: twice what counts as very strong evidence
# (Kass & Raftery, J. Am. Stat. Assoc. 90 (1995) 773-795), since residuals are no white noise.
LEAST_EVIDENCE = 10.0
# Evaluations of the refit of a name to another recording.
EVALUATIONS = 25


@dataclass
class OpenSet:
    """Holds names that could each stand for one effect.

    Attributes
    ----------
    effect
        The name that the first recording preferred.
    models
        Values by term and symbol of the model with each name, the preferred one first; as the last
        recording that judged it has them. A search of all recordings together may put others in
        their place.
    excess
        Whitened error that each name leaves beyond the best of the set, one number for each
        recording, the first one included; 0 is the best.
    evidence
        Log-likelihood of each name below that of the best, over all designed recordings.
    without
        Whitened error that the model without any of the names leaves beyond the best of the set,
        one number for each designed recording that judged the present names.
    left
        Names that are not excluded; none where the set was withdrawn (`joint_judgement`).
    together
        Names that a search of all recordings together put in their place, or beside them
        (`joint_judgement`).
    doubted
        Names that such a search does not confirm and that fit as well as what it names, so that a
        further recording has to decide.
    names
        Those that the first recording left open.
    """

    effect: str
    models: dict[str, Values]
    excess: dict[str, list[float]] = field(default_factory=dict)
    evidence: dict[str, float] = field(default_factory=dict)
    without: list[float] = field(default_factory=list)
    left: list[str] = field(default_factory=list)
    together: list[str] = field(default_factory=list)
    doubted: list[str] = field(default_factory=list)
    names: list[str] = field(init=False)

    def __post_init__(self) -> None:
        self.names = list(self.models)
        self.left = self.left or list(self.models)

    @property
    def open(self) -> bool:
        """Tell whether more than one name is left."""
        return len(self.left) > 1

    @property
    def undecided(self) -> bool:
        """Tell whether doubted names are left, and others beside them."""
        return 0 < len(set(self.left) & set(self.doubted)) < len(self.left)

    @property
    def upheld(self) -> list[str]:
        """Return the names that stood before others were named beside them, as far as they are
        left; all that are left where none of these is.
        """
        return [name for name in self.left if name in self.doubted] or self.left

    def missing(self, one: str, other: str) -> float:
        """Return the error beyond that of the likelier one of two names which further recordings
        have to add, so that all of them exclude the other one; 0...1.
        """
        likelier, rival = sorted((one, other), key=lambda name: self.evidence.get(name, 0.0))
        return RIVAL_EXCESS - (sum(self.excess.get(rival, [])) - sum(self.excess.get(likelier, [])))

    def model(self, name: str) -> Values:
        """Return the values of the model with one of the names, without those of the preferred one
        in whose place it stands.
        """
        values, preferred = self.models[name], next(iter(self.models))
        if name == preferred:
            return values
        terms = with_term(without_term(list(values), preferred), name)
        return {term: values[term] for term in terms if term in values}

    def fitted(self, fitter: Fitter, name: str) -> Fit:
        """Return the model with one of the names, fitted to another recording.

        Parameters
        ----------
        fitter
            Of that recording.
        name
            One of `models`.
        """
        values = self.model(name)
        return fitter.fit(with_term(list(values), name), values, evaluations=EVALUATIONS)

    def fitted_without(self, fitter: Fitter, name: str) -> Fit:
        """Return the model with one of the names, fitted to another recording without that name.

        Parameters
        ----------
        fitter, name
            See `fitted`.
        """
        values = self.model(name)
        return fitter.fit(without_term(list(values), name), values, evaluations=EVALUATIONS)


def remaining(one: OpenSet, judged: Sequence[str]) -> list[str]:
    """Return the names of a set that no recording excludes, the likeliest first.

    A name is excluded where one recording leaves it `RIVAL_EXCESS` more error than the best there,
    or all recordings together leave it so much more than the likeliest name, and all designed
    recordings together speak against it. The odds of a rival fall with its excess (`ODDS_SCALE`),
    and those of independent recordings multiply. It is excluded, too, where it leaves more than
    `LARGEST_LOSS` of what the likeliest name takes off the error of all designed recordings, if
    that is `LEAST_TAKEN` at least, and these speak against it by `LEAST_EVIDENCE`. A general term
    stays beside a special case of it, or of one of its special cases, only where it does better.

    Parameters
    ----------
    one
        The set with what was judged so far.
    judged
        Names that the last recording judged.
    """
    best = min(judged, key=lambda name: one.evidence[name])

    def beyond(name: str, last: int) -> float:
        return sum(one.excess[name][-last:]) - sum(one.excess[best][-last:])

    def excluded(name: str) -> bool:
        less_likely = one.evidence[name] - one.evidence[best]
        judged_by = len(one.without)
        if judged_by and less_likely > LEAST_EVIDENCE:
            taken = sum(one.without) - sum(one.excess[best][-judged_by:])
            if beyond(name, judged_by) > LARGEST_LOSS * taken > LARGEST_LOSS * LEAST_TAKEN:
                return True
        most = max(*one.excess[name], beyond(name, len(one.excess[name])))
        return most >= RIVAL_EXCESS and less_likely > 0.0

    kept = [name for name in judged if not excluded(name)]
    # A general term that does no better than its special case says nothing of its own.
    kept = [
        name
        for name in kept
        if not any(
            special in kept and one.evidence[special] - one.evidence[name] < 1.0
            for special in _special_cases(name)
        )
    ]
    return sorted(kept, key=lambda name: one.evidence[name])


def _special_cases(name: str) -> set[str]:
    """Return the special cases of a term, and those of them in turn."""
    found = set(term_library()[name].generalises)
    return found.union(*(_special_cases(special) for special in found))
