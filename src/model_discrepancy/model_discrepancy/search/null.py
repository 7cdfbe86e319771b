"""The null distribution of a recording is what a library finds where nothing is missing.

The noise of the recording (what neither the base model nor generic regressors of the movement
predict) is cut into stretches, and each stretch is given a random sign (wild bootstrap, Wu 1986,
Ann. Statist. 14, 1261; by stretches, Shao 2010, J. Am. Stat. Assoc. 105, 218). Whatever follows the
movement is destroyed by that; the noise of each channel, tremor, slow torque and a reflex that
varies from stretch to stretch keep their size, their spectrum and their place after the movements.
The same screening on such noise gives the largest gain that each candidate reaches by chance. A
candidate that follows slow torque reaches ten times as much by chance as a plain spring does, and a
threshold of the reflex that only the fastest movements pass ten times as much as one that most of
them pass. Each point of a candidate's grid is therefore measured in units of its own chance gain,
and the largest of these ratios over the whole library makes the threshold (balanced maxima, Romano
& Wolf 2010, Ann. Statist. 38, 598).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtri, stdtrit

from ankle_physics.term import Values
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.parameter_scale import nonlinear
from model_discrepancy.search.acting_stretches import (
    FEWEST_STRETCHES,
    acting_stretches,
    stretch_numbers,
)

DRAWS = 160
# False alarms that are allowed in one recording, for the library and for the generic regressors.
FALSE_ALARM = 0.005
# A candidate's own unit: the gain that it exceeds by chance in one of twenty such recordings.
_UNIT_EXCEEDANCE = 0.05
# Of the noise's power, that no candidate explains: its own rounding.
_LEAST_NOISE_SHARE = 1e-3
# Of one candidate among the fifty of the library.
_CANDIDATE_EXCEEDANCE = FALSE_ALARM / 50.0
# Mean of the standard Gumbel distribution.
_EULER = 0.5772156649


@dataclass
class Null:
    """Holds surrogates of a recording's noise, and the largest gain of each candidate on each.

    Attributes
    ----------
    own
        The whitened noise itself, shape (rows,).
    stretch
        Number of the stretch that each of these rows lies in, shape (rows,).
    signs
        Of each stretch in each draw, shape (stretches, DRAWS).
    noise
        Surrogates of the whitened rows, shape (rows, DRAWS).
    gains
        Share of each surrogate's power that a candidate takes off at most, by candidate, each of
        shape (DRAWS,).
    points
        The same for each point of a candidate's grid: its nonlinear parameters, and the shares.
    """

    own: np.ndarray = field(repr=False)
    stretch: np.ndarray = field(repr=False)
    signs: np.ndarray = field(repr=False)
    noise: np.ndarray = field(init=False, repr=False)
    gains: dict[str, np.ndarray] = field(default_factory=dict, repr=False)
    points: dict[str, list[tuple[np.ndarray, np.ndarray]]] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        self.noise = self.drawn
        self._begins = np.flatnonzero(np.diff(self.stretch, prepend=-1))
        self._power = np.sum(self.noise**2, axis=0)
        # Asked for a thousand times after the surrogates were tried.
        self._thresholds: dict[str, tuple[np.ndarray, np.ndarray]] = {}

    @classmethod
    def of(cls, noise: np.ndarray, time: np.ndarray, used: np.ndarray, seed: int = 0) -> Null:
        """Draw surrogates.

        Parameters
        ----------
        noise
            Whitened rows, shape (count,).
        time
            Of the rows [s], shape (count,).
        used
            Rows that are fitted, bool, shape (count,).
        seed
            Of the signs.
        """
        stretch = stretch_numbers(time)
        signs = np.random.default_rng(seed).choice(
            np.array([-1.0, 1.0], dtype=np.float32), (int(stretch.max()) + 1, DRAWS)
        )
        return cls(noise[used], stretch[used], signs)

    @property
    def drawn(self) -> np.ndarray:
        """Return the surrogates as they were drawn, nothing projected out, shape (rows, DRAWS)."""
        return self.drawn_from(self.own)

    def drawn_from(self, noise: np.ndarray) -> np.ndarray:
        """Return surrogates of other whitened noise in these rows, shape (rows,), with the same
        signs, shape (rows, DRAWS).
        """
        return noise.astype(np.float32)[:, None] * self.signs[self.stretch]

    def project_out(self, basis: np.ndarray) -> None:
        """Take out what the base model imitates: the span of this orthonormal basis (rows, p)."""
        narrow = basis.astype(np.float32)
        self.noise = self.noise - narrow @ (narrow.T @ self.noise)
        self._power = np.sum(self.noise**2, axis=0)

    def observe(self, name: str, span: np.ndarray, point: Values | None = None) -> None:
        """Let one point of a candidate try the surrogates; one that acts in too few stretches is no
        candidate.

        What the candidate itself explains of the noise is taken out first: it is no noise if the
        candidate is right, and next to nothing if it is not.

        Parameters
        ----------
        name
            Of the candidate.
        span
            Orthonormal basis of its columns, shape (rows, p), orthogonal to what was projected out.
        point
            Values of its nonlinear parameters; None where it has none.
        """
        products = np.array([part.T @ part for part in np.split(span, self._begins[1:])])
        stretches = acting_stretches(np.trace(products, axis1=1, axis2=2))
        if stretches < FEWEST_STRETCHES:
            return
        shares = np.add.reduceat(span * self.own[:, None], self._begins, axis=0)
        explained = shares.sum(axis=0)
        # The surrogates' projection on the span, less what the candidate explains of the noise.
        kept = (shares - products @ explained).T @ self.signs[self.stretch[self._begins]]
        left = np.maximum(self._power - explained @ explained, _LEAST_NOISE_SHARE * self._power)
        taken = np.sum(kept**2, axis=0) / left * _tail_ratio(stretches)
        self.gains[name] = np.maximum(self.gains.get(name, 0.0), taken)
        self.points.setdefault(name, []).append((_place(name, point or {}), taken))
        self._thresholds = {}

    @property
    def observed(self) -> bool:
        """Tell whether any candidate has tried the surrogates."""
        return bool(self.gains)

    def threshold(self, name: str, values: Values | None = None) -> float:
        """Return the gain that a candidate must exceed: by chance, no term of the library does so
        in 1 - `FALSE_ALARM` of recordings like this one.

        Parameters
        ----------
        name
            Of the candidate; one that tried no surrogate has the largest threshold of all.
        values
            Of its parameters: the threshold is the largest one of the points around them. None: the
            largest one of all points.
        """
        if not self.gains:
            return 0.0
        self._thresholds = self._thresholds or self._by_point()
        if name not in self._thresholds:
            return float(max(np.max(gains) for _, gains in self._thresholds.values()))
        places, gains = self._thresholds[name]
        if values is None or places.shape[1] == 0:
            return float(np.max(gains))
        apart = _steps_apart(places, _place(name, values))
        around = apart < max(1.0, float(np.min(apart)) + 1e-9)
        return float(np.max(gains[around]))

    def threshold_of(self, name: str, fit: Fit) -> float:
        """Return the gain that a term must exceed with the values that it has in a model."""
        return self.threshold(name, fit.values[name])

    def _by_point(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Return the places of each candidate's points, and the gain that each must exceed."""
        flat = [
            (name, place, shares) for name, tried in self.points.items() for place, shares in tried
        ]
        flat += [
            (name, np.zeros(0), shares)
            for name, shares in self.gains.items()
            if name not in self.points
        ]
        least = balanced([shares for _, _, shares in flat])
        found: dict[str, list[tuple[np.ndarray, float]]] = {}
        for (name, place, _), gain in zip(flat, least, strict=True):
            found.setdefault(name, []).append((place, gain))
        return {
            name: (np.array([place for place, _ in tried]), np.array([gain for _, gain in tried]))
            for name, tried in found.items()
        }


def _place(name: str, values: Values) -> np.ndarray:
    """Return the nonlinear parameters of a candidate, shape (parameters,)."""
    return np.array([float(values[p.symbol]) for _, p in nonlinear([name])] if values else [])


def _steps_apart(places: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return how many steps of a grid each of its points is away, in the direction in which it is
    farthest, shape (points,).

    Parameters
    ----------
    places
        Of the points, shape (points, parameters).
    place
        Shape (parameters,).
    """
    apart = np.zeros(len(places))
    for along, value in zip(places.T, place, strict=True):
        steps = np.unique(along)
        numbers = np.arange(len(steps))
        own = np.interp(value, steps, numbers)
        apart = np.maximum(apart, np.abs(np.interp(along, steps, numbers) - own))
    return apart


def balanced(gains: Sequence[np.ndarray]) -> np.ndarray:
    """Return the gain that each of some candidates must exceed, so that all of them together do not
    by chance; shape (candidates,).

    Parameters
    ----------
    gains
        Of each on surrogates, each of shape (draws,).
    """
    units = np.array([exceeded_by_chance(one, _UNIT_EXCEEDANCE) for one in gains])
    ratios = [one / unit for one, unit in zip(gains, units, strict=True) if unit > 0.0]
    return units * (exceeded_by_chance(np.max(ratios, axis=0)) if ratios else 0.0)


def exceeded_by_chance(largest: np.ndarray, probability: float = FALSE_ALARM) -> float:
    """Return the value that maxima like these exceed with this probability.

    Parameters
    ----------
    largest
        Maxima over many candidates, shape (draws,); they follow a Gumbel distribution.
    probability
        Of exceeding it.
    """
    scale = float(np.std(largest)) * np.sqrt(6.0) / np.pi
    place = float(np.mean(largest)) - _EULER * scale
    return place - scale * float(np.log(-np.log(1.0 - probability)))


def _tail_ratio(stretches: float) -> float:
    """Return by how much a candidate's chance gain exceeds that of a candidate that acts equally in
    very many stretches.

    One that acts in a few of them estimates its own chance from these few: Student's tails instead
    of Gauss's.

    Parameters
    ----------
    stretches
        In which it acts.
    """
    side = 0.5 * _CANDIDATE_EXCEEDANCE
    return float((stdtrit(stretches, side) / ndtri(side)) ** 2)
