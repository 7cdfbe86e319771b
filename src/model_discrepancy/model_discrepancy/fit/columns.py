"""Columns of a model: torque per unit of each linear parameter, as spectra, for given nonlinear
parameters.

The terms are those of the simulation, walked in the order of the signal path. Two of them act as
filters on spectra. Those at the torque sensor filter the sum of all torques. A compliant fixation
with ``S = k_s + b_s s`` lets the foot, of impedance ``Z = I s^2 + B s + K``, move against the plate
(`coupled_foot`), and passes the torque of all other terms on by ``H = S / (S + Z + Z_T)``. Z is
taken from the values that are passed in. The measured torque must not be used for the foot's
motion: near the resonance its noise would predict itself.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from copy import copy
from functools import reduce
from typing import Any

import numpy as np

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.joint_profile import joint_in_force
from ankle_physics.operating_parameters import SPAN
from ankle_physics.term import Place, term_library
from model_discrepancy.fit.coupled_foot import (
    MOST_ROUNDS,
    Foot,
    Impedance,
    transmission,
)
from model_discrepancy.fit.motion_path import CACHE_SIZE, MotionPath
from model_discrepancy.fit.recent_results import RecentResults
from model_discrepancy.fit.rows import Rows
from model_discrepancy.fit.signal_path import (
    FOOT_PARAMETERS,
    Column,
    Owner,
    Stage,
    Values,
    foot_impedance,
)
from model_discrepancy.recording.motion import Motion
from model_discrepancy.recording.torque_reading import sensor_response


class Columns:
    """Computes columns for one recording; remembers what did not change since the last calls.

    Several threads may ask at the same time.

    Parameters
    ----------
    motion
        Of the recording.
    rows
        The operator whose spectra are wanted.
    """

    def __init__(self, motion: Motion, rows: Rows) -> None:
        self.motion = motion
        self.rows = rows
        self.mean_angle = float(np.mean(motion.position))
        # Of all samples but the outermost hundredth, which may be single ones.
        self.angle_span = 2.0 * float(np.quantile(np.abs(motion.position - self.mean_angle), 0.99))
        self.mean_activation = float(np.mean(motion.activation))
        self.target = rows.spectrum(motion.torque)
        self._path = MotionPath(motion)
        self._known: defaultdict[str, RecentResults[Any]] = defaultdict(
            lambda: RecentResults(CACHE_SIZE)
        )

    def convention(self, name: str) -> dict[str, float]:
        """Return the values of the parameters that are not fitted: angles and the torque of the
        muscles at the recording's mean, the range of angles as the recording's, all else typical.
        """
        joint = joint_in_force()
        means = {joint.position_unit: self.mean_angle, joint.torque_unit: self.mean_activation}
        return {
            p.symbol: self.angle_span if p.symbol == SPAN else means.get(p.unit, p.default)
            for p in term_library()[name].parameters
            if not p.fitted and not p.linear
        }

    def foot(self, values: Values, rounds: int = MOST_ROUNDS) -> Foot | None:
        """Return the foot behind the compliant fixation of a model, as `MotionPath.foot` does."""
        return self._path.foot(values, rounds)

    def spectra(self, values: Values, foot: Foot | None = None) -> dict[Column, np.ndarray]:
        """Return the spectrum of each column of the model with these terms and values, by (term,
        symbol).

        Parameters
        ----------
        values
            By term and symbol.
        foot
            Behind a compliant fixation, held; None: as it moves with these values.
        """
        return {
            (own.term.name, symbol): spectrum
            for own in self._path.owners(values, foot or self.foot(values))
            for symbol, spectrum in self._sensed(own).items()
        }

    def offset(self, values: Values, foot: Foot | None = None) -> np.ndarray | None:
        """Return the spectrum of the torque that belongs to no column; None where there is none.

        It is what the columns, each behind the straps, leave of the torque on a foot that is held.

        Parameters
        ----------
        values, foot
            As `spectra` takes them.
        """
        foot = foot or self.foot(values)
        return None if foot is None else self._offset(self._path.owners(values, foot), foot)

    def _offset(self, owners: Sequence[Owner], foot: Foot) -> np.ndarray | None:
        """Return what `offset` does, remembered."""
        direct = [own for own in owners if own.impedes]
        through = next((own for own in owners if not own.past_straps), None)
        if not direct or through is None:
            return None

        def made() -> np.ndarray:
            known = {own.term.name: self._at_joint(own) for own in direct}
            signals = self._path.signals(direct[0])
            motion = signals.foot_acceleration, signals.foot_velocity, signals.foot_position
            whole = self._pushed(foot)
            for (name, symbol), like, signal in zip(
                FOOT_PARAMETERS, foot.like, motion, strict=True
            ):
                # The columns of the impedance are this motion, but for its mean.
                column = known[name][symbol] if name in known else self.rows.spectrum(signal)
                whole = whole + like * column
            return self._past_straps(whole, direct[0], through, foot)

        key = (direct[0].path, through.behind)
        found: np.ndarray = self._known["offset"].of(key, made)
        return found

    def _past_straps(
        self, whole: np.ndarray, direct: Owner, through: Owner, foot: Foot
    ) -> np.ndarray:
        """Return the spectrum of torque on the foot that the sensor sees whole, less what passes
        the straps of the torque that moves a foot that is held.
        """
        sensor, straps = self._gain(direct), self._gain(through)
        held = self._known["held"].of(foot.number, lambda: self.rows.spectrum(foot.torque))
        return np.asarray((whole if sensor is None else sensor * whole) - straps * held)

    def _pushed(self, foot: Foot) -> np.ndarray:
        """Return the spectrum of the torque on a foot that is not like an impedance, remembered."""
        found: np.ndarray = self._known["pushed"].of(
            foot.number, lambda: self.rows.spectrum(foot.rest.torque)
        )
        return found

    def torque(self, values: Values) -> np.ndarray:
        """Return the spectrum of the torque of a model with these values, linear ones too."""
        foot = self.foot(values)
        total = np.zeros_like(self.target)
        for (name, symbol), spectrum in self.spectra(values, foot).items():
            total += values[name][symbol] * spectrum
        offset = self.offset(values, foot)
        return total if offset is None else total + offset

    def change(
        self,
        values: Values,
        moved: Values,
        amplitudes: Mapping[Column, float],
        foot: Foot | None = None,
    ) -> np.ndarray | None:
        """Return the spectrum of what a model's torque changes by where other values are put in.

        It is the sum over all columns, which is transformed once instead of each column.

        Parameters
        ----------
        values, moved
            Of the same terms, before and after.
        amplitudes
            Of the columns, the same before and after.
        foot
            Behind a compliant fixation, held; None: as it moves with the values before.

        Returns
        -------
        np.ndarray | None
            None where no column changes.
        """
        total: np.ndarray | None = None
        foot = foot or self.foot(values)

        def add(part: np.ndarray) -> None:
            nonlocal total
            total = part if total is None else np.add(total, part, out=total)

        # Torque behind the same filter, and the one whose filter it is.
        sums: dict[Any, tuple[Owner, np.ndarray]] = {}
        # Impedance of the foot, whose motion changes.
        moved_foot: list[Owner] = []
        owners = self._path.owners(values, foot), self._path.owners(moved, foot)
        for old, new in zip(*owners, strict=True):
            name = old.term.name
            if (old.key, old.behind) == (new.key, new.behind):
                continue
            before = self._sensed(old)
            if old.key == new.key:
                for symbol, column in self._sensed(new).items():
                    add(amplitudes[name, symbol] * (column - before[symbol]))
                continue
            for symbol, column in before.items():
                add(-amplitudes[name, symbol] * column)
            if new.impedes and foot is not None:
                moved_foot.append(new)
                continue
            for symbol, column in self._torques(new).items():
                torque = amplitudes[name, symbol] * column
                if new.behind in sums:
                    torque += sums[new.behind][1]
                sums[new.behind] = (new, torque)
        for owner, torque in sums.values():
            gain, spectrum = self._gain(owner), self.rows.spectrum(torque)
            add(spectrum if gain is None else gain * spectrum)
        if foot is not None:
            here = self._offset(owners[0], foot)
            if moved_foot:
                add(self._on_moved_foot(moved_foot, owners[1], amplitudes, foot))
                there = None
            else:
                there = self._offset(owners[1], foot)
            if here is not None and here is not there:
                add(-here if there is None else there - here)
        return total

    def _on_moved_foot(
        self,
        direct: Sequence[Owner],
        owners: Sequence[Owner],
        amplitudes: Mapping[Column, float],
        foot: Foot,
    ) -> np.ndarray:
        """Return the spectrum of the torque of the foot's impedance, and of `offset`, with other
        values: both follow from the motion, which is transformed once.
        """
        through = next((own for own in owners if not own.past_straps), None)
        of = dict.fromkeys(FOOT_PARAMETERS, 0.0)
        if through is not None:
            of |= dict(zip(FOOT_PARAMETERS, foot.like, strict=True))
        for own in direct:
            for column in FOOT_PARAMETERS:
                if column[0] == own.term.name:
                    of[column] += amplitudes[column]
        inertia, viscosity, stiffness = of.values()
        whole = self._torque_of(direct[0], foot, (inertia, viscosity, stiffness))
        if through is not None:
            return self._past_straps(whole + self._pushed(foot), direct[0], through, foot)
        sensor = self._gain(direct[0])
        return whole if sensor is None else sensor * whole

    def _torque_of(self, own: Owner, foot: Foot, of: Impedance) -> np.ndarray:
        """Return the spectrum of the torque of an impedance on the foot as this term moves it."""
        mover = self._path.mover(own.stages, own.values)
        return self.rows.spectrum(mover.torque(foot.rest, foot.like, of))

    def _sensed(self, own: Owner) -> Mapping[str, np.ndarray]:
        """Return the columns of one term as the torque sensor reports them."""

        def sensed() -> Mapping[str, np.ndarray]:
            gain, at_joint = self._gain(own), self._at_joint(own)
            if gain is None:
                return at_joint
            return {symbol: gain * spectrum for symbol, spectrum in at_joint.items()}

        known = self._known[own.term.name]
        columns: Mapping[str, np.ndarray] = known.of((own.key, own.behind), sensed)
        return columns

    def _at_joint(self, own: Owner) -> Mapping[str, np.ndarray]:
        """Return the columns of one term before any filter, remembered."""

        def made() -> dict[str, np.ndarray]:
            return {s: self.rows.spectrum(column) for s, column in self._torques(own).items()}

        columns: Mapping[str, np.ndarray] = self._known["at " + own.term.name].of(own.key, made)
        return columns

    def _gain(self, own: Owner) -> np.ndarray | None:
        """Return the filter behind a term, remembered."""
        gain: np.ndarray | None = self._known["filter"].of(own.behind, lambda: self._filter(own))
        return gain

    def _torques(self, own: Owner) -> dict[str, np.ndarray]:
        """Return the torque per unit of each linear parameter of one term, each of shape (n,)."""
        state = own.term.start(self.motion.rate)
        return own.term.torque(copy(self._path.signals(own)), own.values[own.term.name], state)

    def _filter(self, own: Owner) -> np.ndarray | None:
        """Return the filter between a term's torque and the reading; None for nothing.

        It holds the straps, for what acts on the foot, and the sensor.
        """
        filters = []
        for stage in own.stages:
            other = stage.term
            if isinstance(other, CompliantCoupling) and own.foot is not None:
                if not own.past_straps:
                    impedance = foot_impedance(own.values)
                    inertia, viscosity, stiffness = (
                        mine + like for mine, like in zip(impedance, own.foot.like, strict=True)
                    )
                    strap = other.linearised(own.values[other.name])
                    filters.append(
                        transmission(self.rows.frequency, strap, (inertia, viscosity, stiffness))
                    )
            elif stage.place is Place.TORQUE_SENSOR:
                filters.append(self._response(stage, own.values))
        return reduce(np.multiply, filters) if filters else None

    def _response(self, stage: Stage, values: Values) -> np.ndarray:
        """Return the frequency response of a term at the torque sensor, remembered: the straps
        change more often.
        """
        term = stage.term

        def made() -> np.ndarray:
            return sensor_response(term, self.rows.frequency, values[term.name])

        response: np.ndarray = self._known["response"].of(stage.key(values), made)
        return response
