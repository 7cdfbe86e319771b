"""Motion on its way from the plate to the joint, as the terms of a model change it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from copy import copy
from typing import Any

import numpy as np

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.signals import Signals
from ankle_physics.term import PATH, Place, term_library
from model_discrepancy.fit.coupled_foot import MOST_ROUNDS, Foot, Mover, Plate, found_foot
from model_discrepancy.fit.recent_results import RecentResults
from model_discrepancy.fit.signal_path import Owner, Stage, Values, foot_impedance, owners_of
from model_discrepancy.recording.motion import Motion

# Gradients need a handful of neighbours of the current point, for each of the models that are
# fitted at the same time; a spectrum takes 0.1 to 0.2 MB, a movement 3 MB. A diagnosis with nine
# terms takes a tenth longer with 16 of them, and another half a GB with 32.
CACHE_SIZE = 24


class MotionPath:
    """Finds the signals that the terms of a model see; remembers what did not change since the last
    calls.

    Several threads may ask at the same time.

    Parameters
    ----------
    motion
        Of the recording.
    """

    def __init__(self, motion: Motion) -> None:
        self._motion = motion
        self._mean_angle = float(np.mean(motion.position))
        self._known: defaultdict[str, RecentResults[Any]] = defaultdict(
            lambda: RecentResults(CACHE_SIZE)
        )

    def foot(self, values: Values, rounds: int = MOST_ROUNDS) -> Foot | None:
        """Return the foot behind the compliant fixation of a model with these values, linear ones
        too; None where the model has none.

        Parameters
        ----------
        values
            By term and symbol.
        rounds
            At most so many to find how the torque moves the foot.
        """
        stages = self._stages(tuple(values))
        fixation = next(
            (stage.term for stage in stages if isinstance(stage.term, CompliantCoupling)), None
        )
        if fixation is None:
            return None
        key = (rounds, *((name, *given.items()) for name, given in values.items()))
        found: Foot = self._known["foot"].of(key, lambda: self._found(fixation, values, rounds))
        return found

    def owners(self, values: Values, foot: Foot | None) -> list[Owner]:
        """Return the terms that have columns, in the order of the signal path."""
        return owners_of(self._stages(tuple(values)), values, foot)

    def signals(self, own: Owner) -> Signals:
        """Return the signals that a term sees, remembered."""
        signals: Signals = self._known["path"].of(own.path, lambda: self._path(own, own.shaped))
        return signals

    def _path(self, own: Owner, shaped: bool) -> Signals:
        """Return the signals before the joint; those that the reflex sees where they are shaped."""
        signals = copy(self._plate(own.stages, own.values))
        if own.past_straps and not own.impedes:
            return signals
        foot = own.foot
        for stage in own.stages:
            if stage.moves_foot and foot is not None:
                x, v, a = foot.position, foot.velocity, foot.acceleration
                if own.impedes:
                    x, v, a = self.mover(own.stages, own.values).moved(foot.rest, foot.like)
                signals.move_foot(x + self._mean_angle, v, a)
            elif shaped and stage.place is Place.REFLEX_INPUT and stage.transforms:
                term = stage.term
                term.transform(signals, own.values[term.name], term.start(self._motion.rate))
        return signals

    def _plate(self, stages: Sequence[Stage], values: Values) -> Signals:
        """Return the signals that drive the straps, or the foot where there are none;
        remembered.
        """
        m = self._motion
        shaping = [stage for stage in stages if stage.moves_plate]

        def driven() -> Signals:
            signals = Signals(
                m.rate, m.position, m.velocity, m.acceleration, m.activation, m.cocontraction
            )
            for stage in shaping:
                stage.term.transform(signals, values[stage.term.name], stage.term.start(m.rate))
            return signals

        key = tuple(stage.key(values) for stage in shaping)
        plate: Signals = self._known["plate"].of(key, driven)
        return plate

    def mover(self, stages: Sequence[Stage], values: Values) -> Mover:
        """Return what moves the foot behind the compliant fixation of a model, remembered."""
        fixation = next(stage.term for stage in stages if stage.moves_foot)
        assert isinstance(fixation, CompliantCoupling)
        signals = self._plate(stages, values)
        plate = self._known["drive"].of(
            id(signals),
            lambda: (
                signals,
                Plate(
                    self._motion.rate,
                    signals.foot_position - self._mean_angle,
                    signals.foot_velocity,
                    signals.foot_acceleration,
                    jumps=signals.foot_position is not signals.position,
                ),
            ),
        )[1]
        return Mover(plate, fixation, values[fixation.name], foot_impedance(values))

    def _found(self, fixation: CompliantCoupling, values: Values, rounds: int) -> Foot:
        """Return the foot behind a compliant fixation, moved by the plate and by all torque."""
        stages = self._stages(tuple(values))
        inertia, viscosity, stiffness = foot_impedance(values)
        spring, damping = fixation.linearised(values[fixation.name])
        samples = len(self._motion.position)

        def acting(foot: Foot) -> np.ndarray:
            total = np.zeros(samples)
            through = [own for own in self.owners(values, foot) if not own.past_straps]
            if not through:
                return total
            signals = self._path(through[0], shaped=True)
            for own in through:
                state = own.term.start(self._motion.rate)
                given = values[own.term.name]
                for symbol, column in own.term.torque(copy(signals), given, state).items():
                    total += given[symbol] * column
            return total

        return found_foot(
            self.mover(stages, values),
            acting,
            samples,
            (inertia, viscosity + damping, stiffness + spring),
            rounds,
        )

    def _stages(self, names: tuple[str, ...]) -> list[Stage]:
        """Return these terms in the order of the signal path, remembered."""
        stages: list[Stage] = self._known["stages"].of(
            names,
            lambda: sorted(
                (Stage.of(term_library()[name]()) for name in names),
                # Play lies between the plate and the straps.
                key=lambda stage: (PATH.index(stage.place), stage.moves_foot),
            ),
        )
        return stages
