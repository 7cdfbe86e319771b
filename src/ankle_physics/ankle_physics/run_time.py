"""The time of a run, for terms that follow it."""

from __future__ import annotations

import numpy as np

from ankle_physics.term import Values

# Terms that drift state K and G for half a minute into the run, the middle of the shortest trial.
REFERENCE_TIME = 30.0  # s


class RunTime:
    """Counts the samples of a run; `Term.start` puts it in the state under ``run_time``.

    Parameters
    ----------
    rate
        Samples a second [Hz].
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._count = 0

    def advance(self, count: int) -> np.ndarray:
        """Return the times [s] of the next `count` samples, shape (count,)."""
        time = (self._count + np.arange(count)) / self._rate
        self._count += count
        return time

    def skip(self, seconds: float) -> None:
        """Move on by this time [s], to the nearest sample."""
        self._count += round(seconds * self._rate)


class SteadyCourse:
    """Describes a term that changes at constant rates in the course of a run."""

    def course(self, since: np.ndarray, values: Values) -> np.ndarray:
        """Return what the rates are multiplied by [s], shape (n,).

        Parameters
        ----------
        since
            Time since `REFERENCE_TIME` [s], shape (n,).
        values
            Of the term.
        """
        return since


class SettlingCourse(SteadyCourse):
    """Describes a term whose rates, those at `REFERENCE_TIME`, come to an end with the time
    constant T of its parameters: ``T (1 - exp(-since / T))``. One exponential is the simplest
    course that does.
    """

    def course(self, since: np.ndarray, values: Values) -> np.ndarray:
        """Return what the rates are multiplied by [s], shape (n,), as for `SteadyCourse`."""
        time_constant = float(values["T"])
        return np.asarray(-time_constant * np.expm1(-since / time_constant))
