"""A foot that moves against the footplate: its motion depends on the torques on it, which depend on
its motion.

Equation of the foot, with the strap's torque S and the torque T of every term that acts on the
foot::

    S(plate - foot, plate' - foot') = T(foot motion)
    T = I foot'' + B foot' + K foot + other

Solution: inertia, viscosity, stiffness and strap are one linear second-order system and are
integrated exactly for inputs that are linear between samples. What remains, ``other`` (reflex,
further terms, gains that change, an offset), enters as an input and is found by waveform
relaxation: take it as it was, integrate the foot over a window, evaluate the terms on that motion,
repeat until the torque no longer changes. The reflex comes a delay after the motion, so a window
converges in a few rounds; one that does not is halved, down to a `single_sample`. Only models with
such a coupling pay for this.

The sensor at the plate sees S, the torque through the strap, plus the torque of terms that act on
the plate.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.errors import ModelError
from ankle_physics.linear_dynamics import SecondOrder
from ankle_physics.signals import Signals
from ankle_physics.single_sample import torque_between
from ankle_physics.term import State, Values

if TYPE_CHECKING:
    from ankle_physics.model import Entry

# About two reflex delays: longer windows need more rounds, shorter ones more overhead.
LONGEST_WINDOW = 0.1  # s
# A window of the paper's model converges in four to eight rounds, one with springs that yield in
# about 25, whatever its length; one that needs far more is cheaper in halves.
MOST_ROUNDS = 40
# A single sample whose change falls by less in a round would take more than `MOST_ROUNDS` of them;
# it is solved at once. In a longer window changes may rise before they fall.
LEAST_FALL = 0.5
# Of the torque, or of 1 N.m where the torque is smaller; far below any sensor's resolution, so that
# blocks of any size give the same torque.
TOLERANCE = 1e-11
# The linear system is renewed when its coefficients have changed by more than this; smaller changes
# are left to `other`.
RENEWAL_CHANGE = 0.1


@dataclass(frozen=True)
class _Linear:
    """Holds inertia, viscosity and stiffness of the foot (I, B, K), and stiffness and damping of
    the coupling (k, b).
    """

    I: float
    B: float
    K: float
    k: float
    b: float

    def foot(self, x: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the torque [N.m] of the linear foot."""
        return self.I * a + self.B * v + self.K * x

    def far_from(self, other: _Linear) -> bool:
        """Say whether the coefficients differ enough for a renewal."""
        pairs = (
            (self.I, other.I),
            (self.B + self.b, other.B + other.b),
            (self.K + self.k, other.K + other.k),
        )
        return any(
            abs(mine - yours) > RENEWAL_CHANGE * max(abs(yours), 1e-12) for mine, yours in pairs
        )


@dataclass(frozen=True)
class _Answer:
    """Holds what a torque beside the linear foot's makes of a window.

    Attributes
    ----------
    other
        The torque that foot, terms and coupling then have beside the linear ones [N.m], shape (n,).
    parts
        Torque [N.m] of each term on the foot, each of shape (n,).
    scale
        Of the torque on the foot, 1 N.m at least [N.m].
    dynamics, states
        Of foot and terms after the window.
    """

    other: np.ndarray
    parts: dict[str, np.ndarray]
    scale: float
    dynamics: SecondOrder
    states: list[State]


class FootLoop:
    """Computes the motion of a foot behind a compliant coupling, stretch by stretch, from rest in
    equilibrium.

    Parameters
    ----------
    rate
        Sampling rate [Hz].
    coupling
        The compliant coupling of the model.
    terms
        Every term that acts on the foot and may depend on its motion, in the order of the path.
    states
        States of the terms.
    tolerance
        Of the torque, or of 1 N.m where the torque is smaller, at which a window is solved.
    """

    def __init__(
        self,
        rate: float,
        coupling: Entry,
        terms: list[Entry],
        states: list[State],
        tolerance: float = TOLERANCE,
    ) -> None:
        self._tolerance = tolerance
        self._rate = rate
        self._coupling = coupling
        self._terms = terms
        self._states = states
        self._linear: _Linear | None = None
        self._dynamics = SecondOrder(rate)
        self._other = 0.0
        self._longest = max(1, round(LONGEST_WINDOW * rate))
        self._window = self._longest

    @property
    def moving(self) -> tuple[Any, ...]:
        """Return the state of the foot's motion; the terms keep theirs."""
        return self._linear, self._dynamics, self._other, self._window

    @moving.setter
    def moving(self, state: tuple[Any, ...]) -> None:
        self._linear, self._dynamics, self._other, self._window = state

    def run(self, signals: Signals, given: np.ndarray) -> dict[str, np.ndarray]:
        """Move the foot of `signals`, whose foot motion so far is what drives the coupling.

        Parameters
        ----------
        signals
            Motion of plate and foot over the stretch; the foot's is replaced.
        given
            Torque on the foot that does not depend on its motion [N.m], shape (n,).

        Returns
        -------
        dict[str, np.ndarray]
            Torque [N.m] of each term on the foot, each of shape (n,).

        Raises
        ------
        ModelError
            The model's foot has no inertia, or its motion has no solution.
        """
        n = len(signals.position)
        drive = np.stack([signals.foot_position, signals.foot_velocity])
        moved = np.empty((4, n))
        torques = {entry.term.name: np.empty(n) for entry in self._terms}
        start = 0
        while start < n:
            stop = min(start + self._window, n)
            window = signals.between(start, stop)
            values = [_part(entry.values, start, stop) for entry in (self._coupling, *self._terms)]
            self._prepare(window, drive[:, start:stop], given[start:stop], values)
            # A window that does not converge runs away; it is halved.
            with np.errstate(over="ignore", invalid="ignore"):
                parts, rounds = self._solve(window, drive[:, start:stop], given[start:stop], values)
            if parts is None:
                if stop - start == 1:
                    raise ModelError(
                        "the foot's motion does not converge: a term on the foot is too steep for "
                        "the coupling and the inertia"
                    )
                self._window = (stop - start) // 2
                continue
            moved[:, start:stop] = (
                window.foot_position,
                window.foot_velocity,
                window.foot_acceleration,
                window.drive,
            )
            for name, torque in parts.items():
                torques[name][start:stop] = torque
            start = stop
            if rounds <= MOST_ROUNDS // 2:
                self._window = min(2 * self._window, self._longest)
        signals.move_foot(moved[0], moved[1], moved[2])
        signals.drive = moved[3]
        return torques

    def _solve(
        self, window: Signals, drive: np.ndarray, given: np.ndarray, values: list[Values]
    ) -> tuple[dict[str, np.ndarray] | None, int]:
        """Return torques on the foot and the rounds it took; None where a window does not
        converge.
        """
        other, before = np.full(len(given), self._other), math.inf
        for rounds in range(1, MOST_ROUNDS + 1):
            tried = self._answer(other, window, drive, given, values)
            change = float(np.abs(tried.other - other).max())
            if change <= self._tolerance * tried.scale:
                self._keep(tried)
                return tried.parts, rounds
            if not np.isfinite(change) or (len(given) == 1 and change > LEAST_FALL * before):
                break
            other, before = tried.other, change
        if len(given) > 1:
            return None, MOST_ROUNDS
        return self._solve_sample(window, drive, given, values), MOST_ROUNDS

    def _solve_sample(
        self, window: Signals, drive: np.ndarray, given: np.ndarray, values: list[Values]
    ) -> dict[str, np.ndarray] | None:
        """Return torques on the foot during one sample; None where it has no solution."""

        def answer(torque: float) -> _Answer:
            return self._answer(np.array([torque]), window, drive, given, values)

        def ahead(torque: float) -> float:
            return float(answer(torque).other[0]) - torque

        scale = answer(self._other).scale
        solved = torque_between(ahead, self._other, self._tolerance * scale)
        if solved is None:
            return None
        tried = answer(solved)
        self._keep(tried)
        return tried.parts

    def _answer(
        self,
        other: np.ndarray,
        window: Signals,
        drive: np.ndarray,
        given: np.ndarray,
        values: list[Values],
    ) -> _Answer:
        """Return what a torque beside the linear foot's [N.m], shape (n,), makes of a window."""
        linear = self._linear
        assert linear is not None
        omega = math.sqrt((linear.K + linear.k) / linear.I)
        damping = (linear.B + linear.b) / (2.0 * linear.I * omega)
        term = self._coupling.term
        assert isinstance(term, CompliantCoupling)
        dynamics, states = copy.deepcopy((self._dynamics, self._states))
        push = linear.k * drive[0] + linear.b * drive[1] - other
        x, v, a = dynamics.run_with_rates(push / (linear.K + linear.k), omega, damping)
        window.move_foot(x, v, a)
        parts = torques_of(self._terms, window, values[1:], states)
        total = sum(parts.values(), given)
        extension, rate = drive[0] - x, drive[1] - v
        excess = term.coupling_torque(extension, rate, values[0]) - (
            linear.k * extension + linear.b * rate
        )
        return _Answer(
            total - linear.foot(x, v, a) - excess,
            parts,
            max(1.0, float(np.abs(total).max())),
            dynamics,
            states,
        )

    def _keep(self, solved: _Answer) -> None:
        """Go on from what was solved."""
        self._dynamics, self._other = solved.dynamics, float(solved.other[-1])
        for state, new in zip(self._states, solved.states, strict=True):
            state.update(new)

    def _prepare(
        self, window: Signals, drive: np.ndarray, given: np.ndarray, values: list[Values]
    ) -> None:
        """Linearise at the first sample of a window; before the very first, settle the foot in
        equilibrium.
        """
        linear = self._linearise(values)
        if self._linear is None:
            self._linear = linear
            self._settle(window, drive, given, values)
        elif linear.far_from(self._linear):
            old, dynamics = self._linear, self._dynamics
            x, v, push = dynamics.state
            acceleration = ((old.K + old.k) * (push - x) - (old.B + old.b) * v) / old.I
            # The torque that moves the foot stays; what of it counts as linear changes.
            renewed = (
                linear.I * acceleration + (linear.B + linear.b) * v + (linear.K + linear.k) * x
            )
            self._dynamics = SecondOrder(self._rate)
            self._dynamics.resume(x, v, renewed / (linear.K + linear.k))
            self._linear = linear

    def _linearise(self, values: list[Values]) -> _Linear:
        own = {
            entry.term.name: values_of_term
            for entry, values_of_term in zip(self._terms, values[1:], strict=True)
        }

        def first(term: str, symbol: str) -> float:
            return float(np.ravel(own[term][symbol])[0]) if term in own else 0.0

        inertia = first("inertia", "I")
        if inertia <= 0.0:
            raise ModelError(
                f"'{self._coupling.term.name}' needs a foot with inertia: term 'inertia' with I "
                "above 0 kg.m^2"
            )
        term = self._coupling.term
        assert isinstance(term, CompliantCoupling)
        k, b = term.linearised(values[0])
        return _Linear(inertia, first("viscosity", "B"), first("stiffness", "K"), k, b)

    def _settle(
        self, window: Signals, drive: np.ndarray, given: np.ndarray, values: list[Values]
    ) -> None:
        linear = self._linear
        assert linear is not None
        first = window.between(0, 1)
        still = np.zeros(1)
        at_first = [_part(own, 0, 1) for own in values[1:]]

        def other_torque(x: float) -> float:
            first.move_foot(np.array([x]), still, still)
            parts = torques_of(self._terms, first, at_first, copy.deepcopy(self._states))
            return (
                float(given[0]) + sum(float(torque[0]) for torque in parts.values()) - linear.K * x
            )

        def step(x: float) -> float:
            return (linear.k * drive[0, 0] - other_torque(x)) / (linear.K + linear.k) - x

        # A foot that softens may rest far away, too; here it rests beside the plate.
        x, share = float(drive[0, 0]), 1.0
        ahead = step(x)
        for _ in range(4 * MOST_ROUNDS):
            there = step(x + share * ahead)
            if abs(there) > abs(ahead):
                # A foot that is steeper than its linear part would run away.
                share *= 0.5
                continue
            x, ahead, share = x + share * ahead, there, min(2.0 * share, 1.0)
            if abs(ahead) <= self._tolerance:
                break
        self._other = other_torque(x)
        self._dynamics.settle(x)


def torques_of(
    terms: list[Entry], signals: Signals, values: list[Values], states: list[State]
) -> dict[str, np.ndarray]:
    """Walk the terms along the path: transform the signals, then the torque [N.m] of each, shape
    (n,), by term name.
    """
    found: dict[str, np.ndarray] = {}
    for entry, own, state in zip(terms, values, states, strict=True):
        entry.term.transform(signals, own, state)
        parts = [own[s] * column for s, column in entry.term.torque(signals, own, state).items()]
        found[entry.term.name] = (
            sum(parts[1:], parts[0]) if parts else np.zeros(len(signals.position))
        )
    return found


def _part(values: Mapping[str, Any], start: int, stop: int) -> Values:
    return {
        symbol: value[start:stop] if np.ndim(value) else value for symbol, value in values.items()
    }
