"""Linear building blocks of terms, compiled: delay, first- and second-order response.

Each keeps its state between calls and integrates exactly for an input that is linear between
samples (first-order hold), so that the result depends on the sampling rate only through the input.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numba import njit
from scipy.linalg import expm


class Stateful:
    """Holds numbers and arrays that a run changes.

    A foot behind a compliant coupling tries each stretch several times, from the same state: copies
    of it have to be cheap.
    """

    def __deepcopy__(self, memo: dict[int, Any]) -> Any:
        """Return a copy with arrays of its own."""
        copied = object.__new__(type(self))
        for name, value in vars(self).items():
            own = value.copy() if isinstance(value, np.ndarray) else value
            object.__setattr__(copied, name, own)
        return copied


class Delay(Stateful):
    """Delays a signal: ``y(t) = x(t - delay)``, linear between samples; zero before the first
    sample.

    Parameters
    ----------
    rate
        Sampling rate [Hz].
    longest
        Longest delay that will be asked for [s].
    """

    def __init__(self, rate: float, longest: float) -> None:
        self._rate = rate
        self._longest = longest
        self._past = np.zeros(math.ceil(longest * rate) + 2)

    def run(self, x: np.ndarray, delay: float) -> np.ndarray:
        """Return the delayed samples, shape (n,).

        Raises
        ------
        ValueError
            Delay outside 0...longest.
        """
        if not 0.0 <= delay <= self._longest:
            raise ValueError(f"delay {delay:g} s is outside 0 to {self._longest:g} s")
        return _delayed(np.ascontiguousarray(x, dtype=float), delay * self._rate, self._past)


@njit(cache=True, nogil=True)
def _delayed(x: np.ndarray, shift: float, past: np.ndarray) -> np.ndarray:
    """Return x delayed by so many samples; `past` holds the samples before x, then the last ones of
    both.
    """
    out = np.empty(x.size)
    kept = past.size
    whole = math.floor(shift)
    part = shift - whole
    for k in range(x.size):
        at = k - whole
        later = x[at] if at >= 0 else past[kept + at]
        earlier = x[at - 1] if at >= 1 else past[kept + at - 1]
        out[k] = (1.0 - part) * later + part * earlier
    new = min(x.size, kept)
    for k in range(kept - new):
        past[k] = past[k + new]
    for k in range(new):
        past[kept - new + k] = x[x.size - new + k]
    return out


class SecondOrder(Stateful):
    """Filters a signal: ``y'' + 2 z w y' + w^2 y = w^2 x``, unit gain at rest; `run` also gives y'
    and y''.
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._state = np.zeros(3)  # y, y', last input
        self._settings: tuple[float, float] | None = None
        self._step = np.zeros((2, 4))

    def settle(self, x: float) -> None:
        """Start at rest under the constant input x."""
        self.resume(x, 0.0, x)

    def resume(self, y: float, rate: float, x: float) -> None:
        """Start from y, y' and the last input x."""
        self._state[:] = y, rate, x

    @property
    def state(self) -> tuple[float, float, float]:
        """Return y, y' and the last input."""
        return float(self._state[0]), float(self._state[1]), float(self._state[2])

    def run(self, x: np.ndarray, omega: float, damping: float) -> np.ndarray:
        """Return the response y of shape (n,)."""
        return self._respond(x, omega, damping, 1)[0]

    def run_with_rates(self, x: np.ndarray, omega: float, damping: float) -> np.ndarray:
        """Return the response and its first and second derivative, shape (3, n)."""
        return self._respond(x, omega, damping, 3)

    def _respond(self, x: np.ndarray, omega: float, damping: float, rows: int) -> np.ndarray:
        if self._settings != (omega, damping):
            self._step = second_order_step(omega, damping, 1.0 / self._rate)
            self._settings = (omega, damping)
        return _second_order(
            np.ascontiguousarray(x, dtype=float), omega, damping, self._step, self._state, rows
        )


@lru_cache(maxsize=64)  # The filters of one model share few settings.
def second_order_step(omega: float, damping: float, dt: float) -> np.ndarray:
    """Return the rows of ``[y, y']`` after dt from ``[y, y', x now, x at the end]``, shape (2, 4);
    input linear in between. Callers share the array and do not write to it.
    """
    system = np.zeros((4, 4))
    system[0, 1] = 1.0
    system[1] = -(omega**2), -2.0 * damping * omega, omega**2, 0.0
    system[2, 3] = 1.0 / dt
    grown = expm(system * dt)
    step = grown[:2].copy()
    # The last state is the input's rise over dt: x(end) - x(now).
    step[:, 2] -= step[:, 3]
    return step


@njit(cache=True, nogil=True)
def _second_order(
    x: np.ndarray, omega: float, damping: float, step: np.ndarray, state: np.ndarray, rows: int
) -> np.ndarray:
    """Return the response alone (1 row), or with its first and second derivative (3 rows). Changes
    `state`.
    """
    out = np.empty((rows, x.size))
    y, rate, last = state[0], state[1], state[2]
    for k in range(x.size):
        next_y = step[0, 0] * y + step[0, 1] * rate + step[0, 2] * last + step[0, 3] * x[k]
        rate = step[1, 0] * y + step[1, 1] * rate + step[1, 2] * last + step[1, 3] * x[k]
        y = next_y
        last = x[k]
        out[0, k] = y
        if rows == 3:
            out[1, k] = rate
            out[2, k] = omega**2 * (last - y) - 2.0 * damping * omega * rate
    state[0], state[1], state[2] = y, rate, last
    return out


class LedSecondOrders(Stateful):
    """Filters several signals alike: ``y'' + 2 z w y' + w^2 y = w^2 (x + T x')``, gain 1 at rest.

    Parameters
    ----------
    rate
        Sampling rate [Hz].
    count
        Of the signals.
    """

    def __init__(self, rate: float, count: int) -> None:
        self._rate = rate
        self._state = np.zeros((count, 3))  # y, y' without the lead, last input
        self._settings: tuple[float, float] | None = None
        self._step = np.zeros((2, 4))

    def run(self, x: np.ndarray, omega: float, damping: float, lead: float) -> np.ndarray:
        """Return the responses, shape (count, n), to signals of this shape.

        Parameters
        ----------
        x
            Shape (count, n).
        omega, damping
            Natural frequency [rad/s] and damping ratio [1].
        lead
            T [s].
        """
        if self._settings != (omega, damping):
            self._step = second_order_step(omega, damping, 1.0 / self._rate)
            self._settings = (omega, damping)
        return _led(np.ascontiguousarray(x, dtype=float), lead, self._step, self._state)


@njit(cache=True, nogil=True)
def _led(x: np.ndarray, lead: float, step: np.ndarray, state: np.ndarray) -> np.ndarray:
    """Return the response of each row and its derivative times the lead; changes `state`."""
    out = np.empty(x.shape)
    for row in range(x.shape[0]):
        y, rate, last = state[row, 0], state[row, 1], state[row, 2]
        for k in range(x.shape[1]):
            now = x[row, k]
            next_y = step[0, 0] * y + step[0, 1] * rate + step[0, 2] * last + step[0, 3] * now
            rate = step[1, 0] * y + step[1, 1] * rate + step[1, 2] * last + step[1, 3] * now
            y = next_y
            last = now
            out[row, k] = y + lead * rate
        state[row, 0], state[row, 1], state[row, 2] = y, rate, last
    return out


class FirstOrder(Stateful):
    """Filters a signal: ``T y' + y = x`` for a time constant T [s]; exact for an input linear
    between samples.
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._state = np.zeros(2)  # y, last input

    def run(self, x: np.ndarray, time_constant: float) -> np.ndarray:
        """Return the response y of shape (n,)."""
        return _first_order(
            np.ascontiguousarray(x, dtype=float), 1.0 / (self._rate * time_constant), self._state
        )


@njit(cache=True, nogil=True)
def _first_order(x: np.ndarray, ratio: float, state: np.ndarray) -> np.ndarray:
    out = np.empty(x.size)
    decay = math.exp(-ratio)
    now = (1.0 - decay) / ratio - decay
    end = 1.0 - (1.0 - decay) / ratio
    y, last = state[0], state[1]
    for k in range(x.size):
        y = decay * y + now * last + end * x[k]
        last = x[k]
        out[k] = y
    state[0], state[1] = y, last
    return out
