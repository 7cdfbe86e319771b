"""A model runs through time: every term keeps its state from one stretch of samples to the next."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Any

import numpy as np

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.errors import ModelError
from ankle_physics.foot_loop import TOLERANCE, FootLoop, torques_of
from ankle_physics.signals import Signals
from ankle_physics.term import REFLEX_PLACES, Place, State

if TYPE_CHECKING:
    from ankle_physics.model import Entry, Model

# Which torques act where: on the plate, on the foot behind the coupling, or on nothing because they
# only distort what is measured.
PLATE = (Place.ACTUATOR, Place.COUPLING)
FOOT = (Place.INTRINSIC, *REFLEX_PLACES)
SENSORS = (Place.TORQUE_SENSOR, Place.POSITION_SENSOR)


class ModelRun:
    """Runs a model through time; keeps the state of every term between stretches.

    Attributes
    ----------
    parts
        Torque [N.m] of each term during the last stretch, by term name, each of shape (n,).
    """

    def __init__(
        self, model: Model, rate: float, seed: int = 0, tolerance: float = TOLERANCE
    ) -> None:
        self.model = model
        self.parts: dict[str, np.ndarray] = {}
        states = [entry.term.start(rate, seed + index) for index, entry in enumerate(model.entries)]
        pairs = list(zip(model.entries, states, strict=True))
        couplings = [entry for entry in model.entries if isinstance(entry.term, CompliantCoupling)]
        if len(couplings) > 1:
            raise ModelError(
                "a model has one compliant coupling at most; found "
                f"{' and '.join(entry.term.name for entry in couplings)}"
            )
        self._on_plate = [
            (entry, state)
            for entry, state in pairs
            if entry.term.place in PLATE and entry not in couplings
        ]
        self._activation = [
            (entry, state) for entry, state in pairs if entry.term.place is Place.ACTIVATION
        ]
        self._on_foot = [(entry, state) for entry, state in pairs if entry.term.place in FOOT]
        self._sensors = [(entry, state) for entry, state in pairs if entry.term.place in SENSORS]
        self._states = states
        self._loop: FootLoop | None = None
        if couplings:
            terms, their_states = (
                [entry for entry, _ in self._on_foot],
                [state for _, state in self._on_foot],
            )
            self._loop = FootLoop(rate, couplings[0], terms, their_states, tolerance)

    def advance_clock(self, seconds: float) -> None:
        """Let terms that follow the time of the run begin at `seconds` [s] instead of 0."""
        for state in self._states:
            if "run_time" in state:
                state["run_time"].skip(seconds)

    def snapshot(self) -> Any:
        """Return the state of every term, for `restore`."""
        return copy.deepcopy((self._states, self._loop.moving if self._loop else None))

    def restore(self, snapshot: Any) -> None:
        """Go back to a state that `snapshot` gave; the snapshot can be used again."""
        states, moving = copy.deepcopy(snapshot)
        for state, kept in zip(self._states, states, strict=True):
            state.clear()
            state.update(kept)
        if self._loop is not None:
            self._loop.moving = moving

    def torque(self, signals: Signals) -> np.ndarray:
        """Return the torque [N.m], shape (n,), of the next stretch; `signals` then holds all
        intermediate signals.
        """
        self.parts = _walk(self._on_plate, signals)
        given = _walk(self._activation, signals)
        self.parts.update(given)
        if self._loop is None:
            self.parts.update(_walk(self._on_foot, signals))
        else:
            self.parts.update(
                self._loop.run(signals, sum(given.values(), np.zeros(len(signals.position))))
            )
        signals.torque = sum(self.parts.values(), np.zeros(len(signals.position)))
        for entry, state in self._sensors:
            entry.term.transform(signals, entry.values, state)
        return signals.torque


def _walk(pairs: list[tuple[Entry, State]], signals: Signals) -> dict[str, np.ndarray]:
    if not pairs:
        return {}
    return torques_of(
        [entry for entry, _ in pairs],
        signals,
        [entry.values for entry, _ in pairs],
        [state for _, state in pairs],
    )
