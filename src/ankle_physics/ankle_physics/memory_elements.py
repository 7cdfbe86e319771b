"""Compiled nonlinear building blocks of terms that remember movement.

They are the Dahl spring, the spring of Bouc and Wen, the yielding spring, backlash, structure,
bonds and unequal lag.

Each keeps its state between calls and advances sample by sample with the input held linear between
samples.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import ClassVar

import numpy as np
from numba import njit

from ankle_physics.linear_dynamics import Stateful

Kernel = Callable[[np.ndarray, float, float, np.ndarray], np.ndarray]


class SlippingSpring(Stateful):
    """Holds what springs have in common that hold up to a size and then slip; the deflection z
    starts at 0.

    Attributes
    ----------
    kernel
        Compiled; takes position, yield, the factor by which z falls within a sample, and the state
        (z, last position), which it advances; returns z.
    """

    kernel: ClassVar[Kernel]

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._state = np.full(2, np.nan)

    def run(self, x: np.ndarray, yield_size: float, recovery: float = math.inf) -> np.ndarray:
        """Return the deflection z.

        Parameters
        ----------
        x
            Position, shape (n,), in any unit.
        yield_size
            Deflection at which the spring slips, in the unit of x.
        recovery
            Time constant [s] with which z is forgotten at rest; infinite: never.

        Returns
        -------
        np.ndarray
            Shape (n,), in the unit of x.
        """
        forgetting = math.exp(-1.0 / (self._rate * recovery))
        position = np.ascontiguousarray(x, dtype=float)
        return type(self).kernel(position, yield_size, forgetting, self._state)


@njit(cache=True, nogil=True)
def _dahl(x: np.ndarray, yield_size: float, forgetting: float, state: np.ndarray) -> np.ndarray:
    out = np.empty(x.size)
    z, last = state[0], state[1]
    if math.isnan(last):
        z, last = 0.0, x[0]
    for k in range(x.size):
        move = x[k] - last
        last = x[k]
        # Exact for a movement in one direction: z tends to +-yield_size over the distance
        # yield_size.
        limit = yield_size if move > 0.0 else -yield_size
        z = limit + (z - limit) * math.exp(-abs(move) / yield_size)
        z *= forgetting
        out[k] = z
    state[0], state[1] = z, last
    return out


class DahlSpring(SlippingSpring):
    """Models a spring that slips gradually: ``z' = v - |v| z / yield_size - z / recovery``.

    For a step much larger than `yield_size` z saturates there (Dahl 1968). Without recovery it is
    friction.
    """

    kernel = _dahl


@njit(cache=True, nogil=True)
def _bouc_wen(x: np.ndarray, yield_size: float, forgetting: float, state: np.ndarray) -> np.ndarray:
    out = np.empty(x.size)
    z, last = state[0], state[1]
    if math.isnan(last):
        z, last = 0.0, x[0]
    for k in range(x.size):
        move = x[k] - last
        last = x[k]
        if z * move < 0.0:
            # It goes back as far as it came without yielding.
            back = min(abs(move), abs(z))
            z += math.copysign(back, move)
            move -= math.copysign(back, move)
        # Exact for a movement away from rest: z / yield_size = tanh(movement / yield_size).
        further = math.tanh(move / yield_size)
        z = (z + yield_size * further) / (1.0 + z / yield_size * further)
        z *= forgetting
        out[k] = z
    state[0], state[1] = z, last
    return out


class BoucWenSpring(SlippingSpring):
    """Models a spring that is stiff on the way back and slips gradually on the way out:
    ``z' = v (1 - (z / yield_size)^2) - z / recovery`` while |z| grows, ``z' = v - z / recovery``
    while it falls.

    It is the hysteresis of Bouc 1967 and Wen 1976 with the exponent 2 and equal shape factors. Its
    edge is sharper than that of `DahlSpring`: the spring takes up the whole of a movement until it
    has come back to its middle.
    """

    kernel = _bouc_wen


@njit(cache=True, nogil=True)
def _yielding(x: np.ndarray, yield_size: float, forgetting: float, state: np.ndarray) -> np.ndarray:
    out = np.empty(x.size)
    z, last = state[0], state[1]
    if math.isnan(last):
        z, last = 0.0, x[0]
    for k in range(x.size):
        z = min(max((z + x[k] - last) * forgetting, -yield_size), yield_size)
        last = x[k]
        out[k] = z
    state[0], state[1] = z, last
    return out


class YieldingSpring(SlippingSpring):
    """Models a spring that yields at once: ``z' = v - z / recovery``, held within ``-yield_size``
    and ``yield_size``.

    It is the Jenkins element of Iwan's and of Prandtl and Ishlinskii's models, with recovery at
    rest. Unlike `DahlSpring` it is exactly as stiff at any deflection below the yield, and noise of
    the position that is smaller than the yield does not let it forget.
    """

    kernel = _yielding


class BacklashOperator(Stateful):
    """Follows its input only when the gap is used up.

    It starts in the middle of the gap.
    """

    def __init__(self) -> None:
        self._state = np.full(1, np.nan)

    def run(self, x: np.ndarray, gap: float) -> np.ndarray:
        """Return the output, shape (n,), within half a gap of the input."""
        return _play(np.ascontiguousarray(x, dtype=float), 0.5 * gap, self._state)


@njit(cache=True, nogil=True)
def _play(x: np.ndarray, half: float, state: np.ndarray) -> np.ndarray:
    out = np.empty(x.size)
    y = state[0]
    if math.isnan(y):
        y = x[0]
    for k in range(x.size):
        y = min(max(y, x[k] - half), x[k] + half)
        out[k] = y
    state[0] = y
    return out


class Structure(Stateful):
    """Follows a structure that movement breaks and rest rebuilds: ``s' = (1 - s)/recovery - |u| s /
    breaking``.

    s starts at 1. The readiness of a reflex follows it (u = stretch velocity).
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._state = np.ones(1)

    def run(self, u: np.ndarray, breaking: float, recovery: float) -> np.ndarray:
        """Return s in 0...1, shape (n,), before the sample's own movement has broken it."""
        return _structure(
            np.ascontiguousarray(u, dtype=float), 1.0 / self._rate, breaking, recovery, self._state
        )


@njit(cache=True, nogil=True)
def _structure(
    u: np.ndarray, dt: float, breaking: float, recovery: float, state: np.ndarray
) -> np.ndarray:
    out = np.empty(u.size)
    s = state[0]
    for k in range(u.size):
        out[k] = s
        speed = abs(u[k]) / breaking + 1.0 / recovery
        s = (1.0 / recovery) / speed + (s - (1.0 / recovery) / speed) * math.exp(-speed * dt)
    state[0] = s
    return out


class Bonds(Stateful):
    """Carries the stretch of bonds that movement breaks and rest rebuilds, unstretched.

    The intact share s follows ``s' = (1 - s)/recovery - |v| s / breaking``, and the stretch z that
    it carries ``z' = s v - |v| z / breaking``: broken bonds take theirs along, and new ones bring
    none. s starts at 1, z at 0.
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._state = np.array([1.0, 0.0, np.nan])

    def run(self, x: np.ndarray, breaking: float, recovery: float) -> np.ndarray:
        """Return z.

        Parameters
        ----------
        x
            Position, shape (n,), in any unit.
        breaking
            Movement that breaks most bonds, in the unit of x.
        recovery
            Time constant with which rest rebuilds them [s].

        Returns
        -------
        np.ndarray
            Shape (n,), in the unit of x.
        """
        position = np.ascontiguousarray(x, dtype=float)
        return _bonds(position, 1.0 / self._rate, breaking, recovery, self._state)


@njit(cache=True, nogil=True)
def _bonds(
    x: np.ndarray, dt: float, breaking: float, recovery: float, state: np.ndarray
) -> np.ndarray:
    out = np.empty(x.size)
    s, z, last = state[0], state[1], state[2]
    if math.isnan(last):
        last = x[0]
    for k in range(x.size):
        move = x[k] - last
        last = x[k]
        # Exact for a movement in one direction of bonds that are as many as they were before it.
        limit = s * breaking if move > 0.0 else -s * breaking
        z = limit + (z - limit) * math.exp(-abs(move) / breaking)
        out[k] = z
        built = dt / recovery
        change = built + abs(move) / breaking
        s = built / change + (s - built / change) * math.exp(-change)
    state[0], state[1], state[2] = s, z, last
    return out


class UnequalLag(Stateful):
    """Filters by a first-order lag that has another time constant while falling."""

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._state = np.zeros(1)

    def run(self, u: np.ndarray, rising: float, falling: float) -> np.ndarray:
        """Return the response of shape (n,); time constants in s."""
        up, down = (
            -math.expm1(-1.0 / (self._rate * rising)),
            -math.expm1(-1.0 / (self._rate * falling)),
        )
        return _unequal(np.ascontiguousarray(u, dtype=float), up, down, self._state)


@njit(cache=True, nogil=True)
def _unequal(u: np.ndarray, up: float, down: float, state: np.ndarray) -> np.ndarray:
    out = np.empty(u.size)
    y = state[0]
    for k in range(u.size):
        gap = u[k] - y
        y += (up if gap > 0.0 else down) * gap
        out[k] = y
    state[0] = y
    return out
