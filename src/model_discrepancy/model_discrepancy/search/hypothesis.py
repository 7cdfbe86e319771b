"""A hypothesis about what is missing: the terms that one order of choices led to."""

from __future__ import annotations

from dataclasses import dataclass, field

from model_discrepancy.fit.base_model import has_joint
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.search.candidates import Candidates
from model_discrepancy.search.found import Effect, Found, Progress, Trial


# Each is itself: what two hold cannot be compared, since it is arrays.
@dataclass(eq=False)
class Fork:
    """Describes a step at which a second candidate did about as well as the one that was chosen.

    Attributes
    ----------
    effects
        Found before it.
    current
        The model with them.
    trial
        The second candidate.
    """

    effects: list[Effect]
    current: Fit
    trial: Trial

    @property
    def gain(self) -> float:
        """Return the smaller gain of both directions on unseen rows."""
        return min(self.trial.held_out)


@dataclass(eq=False)
class Hypothesis:
    """Holds the terms that one order of choices led to.

    Attributes
    ----------
    found
        Its effects and near misses.
    current
        The model with them.
    candidates
        Finds the next one. Hypotheses that are followed at the same time learn each on its own
        which points of the grids are worth trying.
    progress
        Called with one line for each step.
    begun
        Number of effects that it began with.
    steps
        Taken so far.
    ended
        No further term is worth it, or another hypothesis is well ahead.
    behind
        Another hypothesis is well ahead.
    scores
        Least whitened sum of squares by number of effects.
    forks
        Steps at which it might have gone another way, and that way was not followed.
    first
        What was accepted at its first step.
    """

    found: Found
    current: Fit
    candidates: Candidates
    progress: Progress
    begun: int = 0
    steps: int = 0
    ended: bool = False
    behind: bool = False
    scores: dict[int, float] = field(default_factory=dict)
    forks: list[Fork] = field(default_factory=list)
    first: list[Trial] = field(default_factory=list)

    @property
    def plausible(self) -> bool:
        """Tell whether the model leaves the joint a plausible inertia."""
        return has_joint(self.current)

    @property
    def count(self) -> int:
        """Return the number of effects."""
        return len(self.found.effects)

    def is_behind(self, other: Hypothesis, ratio: float) -> bool:
        """Tell whether another hypothesis leaves less by this ratio with as many effects.

        It is not told before it has more effects than it began with, nor where the other one leaves
        the joint no plausible inertia.

        Parameters
        ----------
        other
            The hypothesis that may be ahead.
        ratio
            Of this whitened sum of squares to the other one's, above 1.
        """
        if self.count <= self.begun or other.plausible < self.plausible:
            return False
        ahead = other.scores.get(self.count, other.current.score if other.ended else None)
        return ahead is not None and self.current.score > ratio * ahead
