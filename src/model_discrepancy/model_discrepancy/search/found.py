"""What a search for missing terms tries and finds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from ankle_physics.term import Place, term_library
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import MATERIAL_SHARE
from model_discrepancy.fit.held_out import HeldOut
from model_discrepancy.search.acting_stretches import FEWEST_STRETCHES

# Of the torque's variance: a named term is less than generic regressors, by which torque that moved
# the plate may be predicted. Two engines' equations of one joint differ by a half of this.
LEAST_TERM_SHARE = 0.5 * MATERIAL_SHARE
# Of K or B. Straps that change neither them nor the torque change nothing that anybody uses: a
# standard error of K is 1 to 2 % at best. Torque differentiated from samples, say, is 2 % less at
# 40 Hz than an inertia's, which straps of 10 kN.m/rad explain beside 1 % of noise.
LEAST_JOINT_CHANGE = 0.02
# Beside more terms than these no equation is exact.
MOST_EXACT_TERMS = 4
# Another term that gains this many times what it gains by chance, on unseen rows too, criticises a
# model, however little torque it changes.
CRITICISING_RATIO = 3.0
# Of the whitened error. A term that takes off so much of what the named ones leave, and on unseen
# rows too, says that these have not the right shape, however little torque it changes: beside right
# names none took off more than 13 %, beside those that stood in for another up to 40 %.
CONTRADICTING_GAIN = 0.2
# Of the whitened error. A term that gains less may not do away with a part of the base model, such
# as the joint's viscosity: it would only stand in for it.
DISPLACING_GAIN = 0.1
_INERTIA = "inertia.I"
# Share of the mismatch, whitened and plain. A term that takes off less of both corrects the
# equation of a larger one, it seems.
REFINEMENT = 0.05
# A term that follows slow torque must gain this share of it from what the muscles held before each
# movement. On the independent rig effects that follow torque gained 0.25 to 0.9 so, and those
# that seemed to, in five recordings with a reflex that varies, 0.12 and less.
MIN_PRECEDING_RATIO = 0.2
# Nor does slow torque follow the sizes of a reflex in one half of a recording by accident as it
# does in the other. In the half that gained less such a term gained this share at least of what it
# gains in the whole; an accident in a recording without a mismatch gained 0.04.
MIN_HALF_RATIO = 0.2

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Trial:
    """Holds one candidate after it was refitted together with all other terms.

    Attributes
    ----------
    name
        The term.
    fit
        The model with it.
    gain
        Share of the whitened sum of squares that it takes off.
    held_out
        The same on unseen rows, in both directions; 0 for candidates far behind the best.
    bic
        Change of BIC; negative is better.
    by_chance
        Gain at which the library as a whole would be exceeded by chance, for this term.
    torque_share
        Power of the torque that it changes beyond what the other terms imitate, as a share of the
        recorded torque's.
    displaced
        "term.symbol" of parts of the base model that vanish with it and did not without it.
    preceding_gain
        Of a term that follows slow torque: what it gains from what the muscles held before each
        movement, compared with their mean torque. None for other terms, and where this is not
        known.
    joint_change
        The largest relative change that it makes of K or B.
    takes_joint
        Whether it leaves the joint hardly any inertia, and more was left without it.
    stretches
        In how many stretches of the recording it acts.
    """

    name: str
    fit: Fit
    gain: float
    held_out: tuple[float, float]
    bic: float
    by_chance: float = 0.0
    torque_share: float = 0.0
    displaced: tuple[str, ...] = ()
    preceding_gain: float | None = None
    joint_change: float = 0.0
    takes_joint: bool = False
    stretches: float = float("inf")

    @property
    def at_bound(self) -> bool:
        """Tell whether a parameter of the term is at a bound of its range."""
        return any(label.startswith(f"{self.name}.") for label in self.fit.at_bounds)

    @property
    def exceeds_chance(self) -> bool:
        """Tell whether the gain exceeds chance."""
        if self.gain <= self.by_chance or not term_library()[self.name].follows_torque:
            return self.gain > self.by_chance
        return follows_beyond_chance(self.gain, self.preceding_gain, self.by_chance)

    @property
    def unconfirmed(self) -> bool:
        """Tell whether it follows the slow torque of the recording and nothing but that torque
        speaks for it: it may explain the noise that it follows.
        """
        return term_library()[self.name].follows_torque and not self.exceeds_chance

    @property
    def accepted(self) -> bool:
        """Tell whether the gain exceeds chance, holds on unseen rows, and is large enough, also for
        what it displaces; and whether it acts in enough stretches and leaves the joint a plausible
        inertia. What is usual may change less torque, where its gain is far beyond chance.
        """
        return (
            self.exceeds_chance
            and min(self.held_out) > self._least_in_a_half
            and (self.torque_share > LEAST_TERM_SHARE or self._usual_beyond_chance)
            and not self.takes_joint
            and self.stretches >= FEWEST_STRETCHES
            and (not self.displaced or self.gain > DISPLACING_GAIN)
        )

    @property
    def _least_in_a_half(self) -> float:
        """Return the gain that an accepted term exceeds in both halves, each scored on the other
        one's fit.
        """
        return MIN_HALF_RATIO * self.gain if term_library()[self.name].follows_torque else 0.0

    @property
    def _usual_beyond_chance(self) -> bool:
        """Tell whether it is what every rig has, its gain is far beyond chance, and it moves the
        joint: straps move K by a tenth with less torque than matters elsewhere.
        """
        moves = self.joint_change > LEAST_JOINT_CHANGE
        return term_library()[self.name].usual and self.criticises and moves

    @property
    def criticises(self) -> bool:
        """Say whether a term that was not accepted shows that the model's shape is not right."""
        return (
            self.exceeds_chance
            and self.gain > CRITICISING_RATIO * self.by_chance
            and min(self.held_out) > 0.0
        )

    @property
    def contradicts(self) -> bool:
        """Say whether a term that was not accepted shows that the named ones are not right."""
        return self.criticises and min(self.gain, *self.held_out) > CONTRADICTING_GAIN


@dataclass(eq=False)
class Effect:
    """Describes a term that was found.

    Attributes
    ----------
    trial
        With the final model.
    errors
        Whitened and plain error after it was added, as `_errors` gives them.
    rivals
        Those that would do instead.
    excluded
        Why each other term that came near, or is of its family, would not do instead; in words, by
        name.
    without
        The final model without it.
    """

    trial: Trial
    errors: np.ndarray
    rivals: list[Trial] = field(default_factory=list)
    excluded: dict[str, str] = field(default_factory=dict)
    without: Fit = field(init=False, repr=False)


@dataclass
class Found:
    """Holds the result of a search.

    Attributes
    ----------
    base
        Fit of the base model.
    final
        Fit of the base model and all accepted terms, with standard errors.
    effects
        In the order in which they were found.
    refinements
        Terms that stay in the model but take off too little of the mismatch to be an effect: no
        equation is exact.
    inflexible
        The final model before flexible terms were added, beside which rivals and other hypotheses
        were tried; None where none was added.
    unrefined
        The final model without the refinements; None where it has none.
    near
        Best candidates that were not accepted.
    other_models
        Models of other hypotheses that were followed to their end and leave about as little.
    base_score
        Whitened sum of squares of the base model.
    by_chance
        Gain that the best candidate of the last step reaches by chance on this recording.
    reflex_stands_in, base_reflex_stands_in
        Whether the reflex of the final model, and that of the base model, stands in for another
        response.
    base_held_out, final_held_out
        Scores of both models on unseen data, which a search leaves behind.
    """

    base: Fit
    final: Fit
    effects: list[Effect] = field(default_factory=list)
    refinements: list[Effect] = field(default_factory=list)
    inflexible: Fit | None = None
    unrefined: Fit | None = None
    near: list[Trial] = field(default_factory=list)
    other_models: list[Fit] = field(default_factory=list)
    base_score: float = 0.0
    by_chance: float = 0.0
    reflex_stands_in: bool = False
    base_reflex_stands_in: bool = False
    base_held_out: HeldOut = field(init=False, repr=False)
    final_held_out: HeldOut = field(init=False, repr=False)

    def nameless(self, base: Fit) -> Found:
        """Return what is left where no name is worth stating.

        Parameters
        ----------
        base
            The base model's fit, with standard errors.
        """
        other = replace(
            self,
            final=base,
            effects=[],
            refinements=[],
            inflexible=None,
            unrefined=None,
            reflex_stands_in=self.base_reflex_stands_in,
        )
        other.base_held_out = other.final_held_out = self.base_held_out
        return other

    @property
    def compared(self) -> Fit:
        """Return the model with which rivals and other hypotheses are to be compared."""
        return self.final if self.inflexible is None else self.inflexible

    @property
    def cut(self) -> float:
        """Return the share of the base model's whitened error that the final model takes off."""
        return 1.0 - self.final.score / self.base_score

    @property
    def needs_many_terms(self) -> bool:
        """Say whether the recording needs so many terms that no equation is exact."""
        return len(self.effects) + len(self.refinements) > MOST_EXACT_TERMS

    @property
    def shape_corrected(self) -> bool:
        """Say whether further terms correct, or would correct, the shape of the named ones."""
        return bool(self.refinements) or any(trial.criticises for trial in self.near)

    @property
    def immaterial(self) -> bool:
        """Say whether no effect changes torque, K or B that matters, beside the others of the final
        model.
        """
        return all(
            effect.trial.torque_share < LEAST_TERM_SHARE
            and effect.trial.joint_change < LEAST_JOINT_CHANGE
            for effect in self.effects
        )

    @property
    def contradicted(self) -> bool:
        """Say whether a term that was not accepted shows that the named ones are not right."""
        return any(trial.contradicts for trial in self.near)

    @property
    def ends_at_bounds(self) -> bool:
        """Say whether the first effect, or half of them, end at a bound of their range, or leave
        the joint the least inertia that is plausible: they stand in for something else.
        """
        ended = {label.split(".")[0] for label in self.final.stopped}
        bounded = [effect.trial.name in ended for effect in self.effects]
        if not bounded:
            return False
        takes_foot = _INERTIA in self.final.at_bounds and _INERTIA not in self.base.at_bounds
        return bounded[0] or 2 * sum(bounded) >= len(bounded) or takes_foot


def follows_beyond_chance(gain: float, preceding_gain: float | None, by_chance: float) -> bool:
    """Say whether a term that follows slow torque follows more than its own response.

    Every reflex varies, which makes slow torque that follows it. Where what the muscles held before
    is not known, nobody knows, and the term is not taken: a half of a human trial with such terms
    was predicted from the other half up to four points worse than without.

    Parameters
    ----------
    gain
        Share of the whitened error that it takes off.
    preceding_gain
        Share that it takes off with what the muscles held before each movement, compared with
        their mean torque; None where this is not known.
    by_chance
        Gain that it would exceed by chance.
    """
    return preceding_gain is not None and preceding_gain > max(
        by_chance, MIN_PRECEDING_RATIO * gain
    )


def place_of(name: str) -> Place:
    """Return where in the signal path a term acts."""
    return term_library()[name].place


def is_usual(name: str) -> bool:
    """Say whether a term, or a special case that it holds, is what every rig has."""
    library = term_library()
    return any(library[one].usual for one in (name, *library[name].generalises))
