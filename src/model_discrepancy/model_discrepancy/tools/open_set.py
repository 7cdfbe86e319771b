"""Names that could each stand for one effect, and what recordings exclude of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ankle_physics.term import ModelValues, term_library
from model_discrepancy.fit.base_model import align
from model_discrepancy.fit.block_bootstrap import STRETCH_S
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.parallel import in_parallel
from model_discrepancy.search.screening import grid, with_term, without_term

# Standard errors of the mean by which a name must leave more error, from stretch to stretch of the
# designed recordings, than the likeliest one (Vuong 1989, Econometrica 57, 307): one in 700 by
# chance, where a set holds some five names.
LEAST_APART = 3.0
# By which it must be the less likely, too (ln): twice what counts as very strong evidence
# (Kass & Raftery, J. Am. Stat. Assoc. 90 (1995) 773-795), since residuals are no white noise.
LEAST_EVIDENCE = 10.0
# Evaluations of the refit of a name to another recording.
EVALUATIONS = 25
# A name is refitted from so many starts: its values of the last recording, and the best points of
# its grid. Another movement may have its least error elsewhere: from its last values alone, dry
# friction of tissues left 28 % more error in a binary sequence than from its grid.
STARTS = 3


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
        Half of the Bayesian information criterion of each name above that of the best, over all
        designed recordings: how much less likely (ln) it is, with what more parameters gain by
        chance taken off.
    errors
        Whitened squared error that each name leaves in each stretch of a recording, an array for
        each recording that `evidence` counts, each of shape (stretches,).
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
    models: dict[str, ModelValues]
    excess: dict[str, list[float]] = field(default_factory=dict)
    evidence: dict[str, float] = field(default_factory=dict)
    errors: dict[str, list[np.ndarray]] = field(default_factory=dict)
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
    def withdrawn(self) -> bool:
        """Tell whether no name is left."""
        return not self.left

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

    @property
    def above_likeliest(self) -> dict[str, float]:
        """Return by how many standard errors each judged name's error exceeds that of the name
        that all judged recordings make likeliest (`apart`).
        """
        best = min(self.errors, key=lambda name: self.evidence[name], default="")
        return {name: self.apart(name, best) for name in self.errors}

    def apart(self, name: str, other: str) -> float:
        """Return by how many of its standard errors the mean error of a name exceeds that of
        another one, from stretch to stretch of all judged recordings; 0 where none was judged.

        Vuong's test (1989, Econometrica 57, 307) of models that are not nested. Each recording
        that judged both counts by the error that the other name leaves there.
        """
        pairs = zip(self.errors.get(name, []), self.errors.get(other, []), strict=False)
        differences = [(one - two) / two.mean() for one, two in pairs]
        if not differences:
            return 0.0
        every = np.concatenate(differences)
        spread = float(np.std(every, ddof=1))
        return float(np.sqrt(len(every)) * every.mean() / spread) if spread > 0.0 else 0.0

    def model(self, name: str) -> ModelValues:
        """Return the values of the model with one of the names, without those of the preferred one
        in whose place it stands.
        """
        values, preferred = self.models[name], next(iter(self.models))
        if name == preferred:
            return values
        terms = with_term(without_term(list(values), preferred), name)
        return {term: values[term] for term in terms if term in values}

    def fitted(self, fitter: Fitter, name: str) -> Fit:
        """Return the model with one of the names, fitted to another recording from several starts,
        with the channels aligned.

        Parameters
        ----------
        fitter
            Of that recording.
        name
            One of `models`.
        """
        last = self.model(name)
        names = with_term(list(last), name)
        rows = fitter.rows
        grid_values = [
            fitter.start_values(names, {**last, name: {**last.get(name, {}), **point}})
            for point in grid(name, rows.count / rows.rate)
        ]
        solved = in_parallel(fitter.solve, grid_values)
        order = sorted(range(len(solved)), key=lambda k: solved[k].score)
        starts = [last, *(grid_values[k] for k in order[: STARTS - 1])]
        fits = [fitter.fit(names, start, evaluations=EVALUATIONS) for start in starts]
        return align(fitter, min(fits, key=lambda fit: fit.score))

    def fitted_without(self, fitter: Fitter, name: str) -> Fit:
        """Return the model with one of the names, fitted to another recording without that name.

        Parameters
        ----------
        fitter, name
            See `fitted`.
        """
        values = self.model(name)
        fit = fitter.fit(without_term(list(values), name), values, evaluations=EVALUATIONS)
        return align(fitter, fit)


def stretch_errors(fit: Fit) -> np.ndarray:
    """Return the whitened squared error that a model leaves in each stretch of `STRETCH_S`, which
    are as good as independent, shape (stretches,).
    """
    squares = np.where(fit.rows.used, fit.residual, 0.0) ** 2
    length = max(int(STRETCH_S * fit.rows.rate), 1)
    return np.add.reduceat(squares, np.arange(0, len(squares), length))


def remaining(one: OpenSet, judged: Sequence[str]) -> list[str]:
    """Return the names of a set that the designed recordings do not exclude, the likeliest first.

    A name is excluded where these recordings together speak against it by `LEAST_EVIDENCE`, and so
    evenly that its error lies `LEAST_APART` above that of the likeliest name. A general term stays
    beside a special case of it, or of one of its special cases, only where it does better.

    Parameters
    ----------
    one
        The set with what was judged so far.
    judged
        Names that the last recording judged.
    """
    best = min(judged, key=lambda name: one.evidence[name])

    def excluded(name: str) -> bool:
        less_likely = one.evidence[name] - one.evidence[best]
        return less_likely > LEAST_EVIDENCE and one.apart(name, best) > LEAST_APART

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
