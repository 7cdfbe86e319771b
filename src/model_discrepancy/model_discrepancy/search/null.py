"""The null distribution of a recording is what a library finds where nothing is missing.

The noise of the recording (what neither the base model nor generic regressors of the movement
predict) is cut into stretches, and each stretch is given a random sign (wild bootstrap, Wu 1986,
Ann. Statist. 14, 1261; by stretches, Shao 2010, J. Am. Stat. Assoc. 105, 218). Whatever follows the
movement is destroyed by that; the noise of each channel, tremor, slow torque and a reflex that
varies from stretch to stretch keep their size, their spectrum and their place after the movements.
The same screening on such noise gives the largest gain that each candidate reaches by chance. A
candidate that follows slow torque, or tries hundreds of frequencies, reaches ten times as much by
chance as a plain spring does; each is therefore measured in units of its own chance gain, and the
largest of these ratios over the whole library makes the threshold (balanced maxima, Romano & Wolf
2010, Ann. Statist. 38, 598).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtri, stdtrit

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
    """

    own: np.ndarray = field(repr=False)
    stretch: np.ndarray = field(repr=False)
    signs: np.ndarray = field(repr=False)
    noise: np.ndarray = field(init=False, repr=False)
    gains: dict[str, np.ndarray] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        self.noise = self.drawn
        self._begins = np.flatnonzero(np.diff(self.stretch, prepend=-1))
        self._power = np.sum(self.noise**2, axis=0)
        # Asked for a thousand times after the surrogates were tried.
        self._thresholds: dict[str, float] = {}

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

    def observe(self, name: str, span: np.ndarray, draw: int | None = None) -> None:
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
        draw
            Number of the surrogate that it tries; None for all of them.
        """
        tried = slice(None) if draw is None else slice(draw, draw + 1)
        products = np.array([part.T @ part for part in np.split(span, self._begins[1:])])
        stretches = acting_stretches(np.trace(products, axis1=1, axis2=2))
        if stretches < FEWEST_STRETCHES:
            return
        shares = np.add.reduceat(span * self.own[:, None], self._begins, axis=0)
        explained = shares.sum(axis=0)
        # The surrogates' projection on the span, less what the candidate explains of the noise.
        signs = self.signs[self.stretch[self._begins]][:, tried]
        kept = (shares - products @ explained).T @ signs
        power = self._power[tried]
        left = np.maximum(power - explained @ explained, _LEAST_NOISE_SHARE * power)
        taken = np.sum(kept**2, axis=0) / left * _tail_ratio(stretches)
        known = self.gains.setdefault(name, np.zeros(self.noise.shape[1]))
        known[tried] = np.maximum(known[tried], taken)
        self._thresholds = {}

    @property
    def observed(self) -> bool:
        """Tell whether any candidate has tried the surrogates."""
        return bool(self.gains)

    def threshold(self, name: str) -> float:
        """Return the gain that a candidate must exceed: by chance, no term of the library does so
        in 1 - `FALSE_ALARM` of recordings like this one.

        Parameters
        ----------
        name
            Of the candidate; one that tried no surrogate has the largest threshold of all.
        """
        if not self.gains:
            return 0.0
        known = self._thresholds or thresholds(self.gains)
        self._thresholds = known
        return known.get(name, max(known.values()))


def thresholds(gains: Mapping[str, np.ndarray]) -> dict[str, float]:
    """Return the gain that each candidate must exceed, so that all of them together do not by
    chance.

    Parameters
    ----------
    gains
        Of each candidate on surrogates, each of shape (draws,).
    """
    units = {name: exceeded_by_chance(g, _UNIT_EXCEEDANCE) for name, g in gains.items()}
    ratios = [g / units[name] for name, g in gains.items() if units[name] > 0.0]
    largest = exceeded_by_chance(np.max(ratios, axis=0)) if ratios else 0.0
    return {name: largest * unit for name, unit in units.items()}


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
