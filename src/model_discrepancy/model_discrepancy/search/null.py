"""The null distribution of a recording is what a library finds where nothing is missing.

The noise of the recording (what neither the base model nor generic regressors of the movement
predict) is cut into stretches, and each stretch is given a random sign (wild bootstrap, Wu 1986,
Ann. Statist. 14, 1261; by stretches, Shao 2010, J. Am. Stat. Assoc. 105, 218). Whatever follows the
movement is destroyed by that; the noise of each channel, tremor, slow torque and a reflex that
varies from stretch to stretch keep their size, their spectrum and their place after the movements.
The same screening on such noise gives the largest gain that the whole library reaches by chance.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

# Longer than a response of the reflex (0.5 s), so that each response keeps its shape.
STRETCH_S = 1.0
DRAWS = 160
# False alarms that are allowed in one recording, for the library and for the generic regressors.
FALSE_ALARM = 0.005
# Mean of the standard Gumbel distribution.
_EULER = 0.5772156649


@dataclass
class Null:
    """Surrogates of a recording's noise, and the largest gain that was reached on each.

    Attributes
    ----------
    noise
        Surrogates of the whitened rows, shape (rows, DRAWS).
    largest
        Share of each surrogate's power that the best candidate so far takes off, shape (DRAWS,).
    """

    noise: np.ndarray = field(repr=False)
    largest: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.largest = np.zeros(self.noise.shape[1])
        self._power = np.sum(self.noise**2, axis=0)

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
        stretch = (time[used] / STRETCH_S).astype(int)
        signs = np.random.default_rng(seed).choice(
            np.array([-1.0, 1.0], dtype=np.float32), (int(stretch.max()) + 1, DRAWS)
        )
        return cls(noise[used].astype(np.float32)[:, None] * signs[stretch])

    def project_out(self, basis: np.ndarray) -> None:
        """Take out what the base model imitates: the span of this orthonormal basis (rows, p)."""
        narrow = basis.astype(np.float32)
        self.noise = self.noise - narrow @ (narrow.T @ self.noise)
        self._power = np.sum(self.noise**2, axis=0)

    def observe(self, span: np.ndarray) -> None:
        """Let one candidate, given by an orthonormal basis (rows, p), try every surrogate."""
        taken = np.sum((span.astype(np.float32).T @ self.noise) ** 2, axis=0)
        self.largest = np.maximum(self.largest, taken / self._power)

    @property
    def threshold(self) -> float:
        """Gain that the library exceeds by chance in `FALSE_ALARM` of recordings like this one."""
        return exceeded_by_chance(self.largest)


def exceeded_by_chance(largest: np.ndarray) -> float:
    """Value that maxima like these exceed with probability `FALSE_ALARM`.

    Parameters
    ----------
    largest
        Maxima over many candidates, shape (draws,); they follow a Gumbel distribution.
    """
    scale = float(np.std(largest)) * np.sqrt(6.0) / np.pi
    place = float(np.mean(largest)) - _EULER * scale
    return place - scale * float(np.log(-np.log(1.0 - FALSE_ALARM)))
