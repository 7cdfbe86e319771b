"""Columns of a model: torque per unit of each linear parameter, as spectra, for given nonlinear
parameters.

The terms are those of the simulation, walked in the order of the signal path. Two of them act as
filters on spectra. Those at the torque sensor filter the sum of all torques. A compliant fixation
with ``S = k_s + b_s s`` lets the foot, of impedance ``Z = I s^2 + B s + K``, move as
``x_foot = H x_plate`` and passes ``H (Z x_plate + other torques)`` on to the plate, ``H = S / (S +
Z)``; Z is taken from the values that are passed in. How far the other torques move the foot is left
out: some per cent of themselves, their stiffness over k_s. The measured torque must not be used for
the foot's motion: near the resonance its noise would predict itself.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.foot_motion import foot_motion
from ankle_physics.joint_profile import joint_in_force
from ankle_physics.signals import Signals
from ankle_physics.term import PATH, Place, Term, term_library
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.fit.recent_results import RecentResults
from model_discrepancy.fit.rows import Rows
from model_discrepancy.recording.motion import Motion

Values = Mapping[str, Mapping[str, float]]
Column = tuple[str, str]
# They act on the foot's motion, H times the plate's, so that their torque has passed the straps
# already.
FOOT_IMPEDANCE = frozenset({"inertia", "viscosity", "stiffness"})
# Gradients need a handful of neighbours of the current point, for each of the models that are
# fitted at the same time; a spectrum takes 0.1 to 0.2 MB.
_CACHE_SIZE = 16


@dataclass(frozen=True)
class _Stage:
    """Holds a term of a model, and what of it does not depend on the values.

    Attributes
    ----------
    term
        The term.
    symbols
        Of its nonlinear parameters; of a compliant fixation: of all.
    moves_foot
        Whether it is a compliant fixation, which the foot's impedance acts on.
    place
        Where it acts.
    transforms
        Whether it changes a signal.
    has_columns
        Whether it adds torque.
    past_straps
        Whether its torque has passed the straps already.
    """

    term: Term
    symbols: tuple[str, ...]
    moves_foot: bool
    place: Place
    transforms: bool
    has_columns: bool
    past_straps: bool

    @classmethod
    def of(cls, term: Term) -> _Stage:
        """Describe a term."""
        moves_foot = isinstance(term, CompliantCoupling)
        return cls(
            term,
            tuple(p.symbol for p in term.parameters if moves_foot or not p.linear),
            moves_foot,
            term.place,
            _transforms(term),
            term.place is not Place.TORQUE_SENSOR and any(p.linear for p in term.parameters),
            _past_straps(term),
        )

    def key(self, values: Values) -> tuple[Any, ...]:
        """Return all of these values that what the term does to a signal depends on."""
        name = self.term.name
        given = values[name]
        own = (name, *(given[symbol] for symbol in self.symbols))
        return (*own, *_foot_impedance(values)) if self.moves_foot else own


@dataclass(frozen=True)
class _Owner:
    """Holds a term that has columns, in its model, and what these depend on.

    Attributes
    ----------
    term
        The owner of the columns.
    stages, values
        Of the whole model, in the order of the signal path.
    key
        All that its torque depends on.
    behind
        All that the filter between its torque and the reading depends on.
    path
        All that the signals before the joint depend on.
    """

    term: Term
    stages: Sequence[_Stage]
    values: Values
    key: Hashable
    behind: Hashable
    path: Hashable


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
        self.mean_activation = float(np.mean(motion.activation))
        self.target = rows.spectrum(motion.torque)
        self._known: defaultdict[str, RecentResults[Any]] = defaultdict(
            lambda: RecentResults(_CACHE_SIZE)
        )

    def convention(self, name: str) -> dict[str, float]:
        """Return the values of the parameters that are not fitted: angles and the torque of the
        muscles at the recording's mean, all else typical.
        """
        joint = joint_in_force()
        means = {joint.position_unit: self.mean_angle, joint.torque_unit: self.mean_activation}
        return {
            p.symbol: means.get(p.unit, p.default)
            for p in term_library()[name].parameters
            if not p.fitted and not p.linear
        }

    def spectra(self, values: Values) -> dict[Column, np.ndarray]:
        """Return the spectrum of each column of the model with these terms and values, by (term,
        symbol).
        """
        return {
            (own.term.name, symbol): spectrum
            for own in self._owners(values)
            for symbol, spectrum in self._sensed(own).items()
        }

    def change(
        self, values: Values, moved: Values, amplitudes: Mapping[Column, float]
    ) -> np.ndarray | None:
        """Return the spectrum of what a model's torque changes by where other values are put in.

        It is the sum over all columns, which is transformed once instead of each column.

        Parameters
        ----------
        values, moved
            Of the same terms, before and after.
        amplitudes
            Of the columns, the same before and after.

        Returns
        -------
        np.ndarray | None
            None where no column changes.
        """
        total: np.ndarray | None = None

        def add(part: np.ndarray) -> None:
            nonlocal total
            total = part if total is None else np.add(total, part, out=total)

        # Torque behind the same filter, and the one whose filter it is.
        sums: dict[Any, tuple[_Owner, np.ndarray]] = {}
        for old, new in zip(self._owners(values), self._owners(moved), strict=True):
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
            for symbol, column in self._torques(new).items():
                torque = amplitudes[name, symbol] * column
                if new.behind in sums:
                    torque += sums[new.behind][1]
                sums[new.behind] = (new, torque)
        for owner, torque in sums.values():
            gain, spectrum = self._gain(owner), self.rows.spectrum(torque)
            add(spectrum if gain is None else gain * spectrum)
        return total

    def _owners(self, values: Values) -> list[_Owner]:
        """Return the terms that have columns, in the order of the signal path."""
        stages = self._stages(tuple(values))
        keys = [stage.key(values) for stage in stages]
        coupling, shaping = (
            tuple(
                key
                for stage, key in zip(stages, keys, strict=True)
                if stage.place is place and stage.transforms
            )
            for place in (Place.COUPLING, Place.REFLEX_INPUT)
        )
        filters = tuple(
            key
            for stage, key in zip(stages, keys, strict=True)
            if stage.place is Place.TORQUE_SENSOR or stage.moves_foot
        )
        return [
            _Owner(
                stage.term,
                stages,
                values,
                (key, coupling, shaping if stage.place is Place.REFLEX_DYNAMICS else ()),
                (stage.past_straps, filters),
                (coupling, shaping),
            )
            for stage, key in zip(stages, keys, strict=True)
            if stage.has_columns
        ]

    def _stages(self, names: tuple[str, ...]) -> list[_Stage]:
        """Return these terms in the order of the signal path, remembered."""
        stages: list[_Stage] = self._known["stages"].of(
            names,
            lambda: sorted(
                (_Stage.of(term_library()[name]()) for name in names),
                key=lambda stage: PATH.index(stage.place),
            ),
        )
        return stages

    def _sensed(self, own: _Owner) -> Mapping[str, np.ndarray]:
        """Return the columns of one term as the torque sensor reports them."""
        name = own.term.name

        def made() -> dict[str, np.ndarray]:
            return {s: self.rows.spectrum(column) for s, column in self._torques(own).items()}

        def sensed() -> Mapping[str, np.ndarray]:
            gain = self._gain(own)
            at_joint: Mapping[str, np.ndarray] = self._known["at " + name].of(own.key, made)
            if gain is None:
                return at_joint
            return {symbol: gain * spectrum for symbol, spectrum in at_joint.items()}

        columns: Mapping[str, np.ndarray] = self._known[name].of((own.key, own.behind), sensed)
        return columns

    def _gain(self, own: _Owner) -> np.ndarray | None:
        """Return the filter behind a term, remembered."""
        gain: np.ndarray | None = self._known["filter"].of(own.behind, lambda: self._filter(own))
        return gain

    def _torques(self, own: _Owner) -> dict[str, np.ndarray]:
        """Return the torque per unit of each linear parameter of one term, each of shape (n,)."""
        signals = self._known["path"].of(own.path, lambda: self._path(own.stages, own.values))
        state = own.term.start(self.motion.rate)
        return own.term.torque(copy(signals), own.values[own.term.name], state)

    def _filter(self, own: _Owner) -> np.ndarray | None:
        """Return the filter between a term's torque and the reading; None for nothing.

        It holds the straps, for what acts on the foot, and the sensor.
        """
        filters = []
        for stage in own.stages:
            other = stage.term
            if isinstance(other, CompliantCoupling) and not _past_straps(own.term):
                filters.append(transmission(self.rows.frequency, other, own.values))
            elif stage.place is Place.TORQUE_SENSOR:
                response = other.response(self.rows.frequency, own.values[other.name])
                if response is None:
                    raise DiagnosisError(
                        f"{other.name} acts at the torque sensor and states no frequency response"
                    )
                filters.append(response)
        return np.prod(filters, axis=0) if filters else None

    def _path(self, stages: Sequence[_Stage], values: Values) -> Signals:
        m = self.motion
        signals = Signals(m.rate, m.position, m.velocity, m.acceleration, m.activation)
        for stage in stages:
            term = stage.term
            if isinstance(term, CompliantCoupling):
                self._move_foot(signals, term, values)
            elif stage.place in (Place.COUPLING, Place.REFLEX_INPUT) and stage.transforms:
                term.transform(signals, values[term.name], term.start(m.rate))
        return signals

    def _move_foot(self, signals: Signals, fixation: CompliantCoupling, values: Values) -> None:
        """Return the foot motion behind a compliant fixation: the plate's, filtered, or integrated
        where the fixation is not linear.
        """
        m = self.motion
        if not fixation.linear:
            x, v, a = foot_motion(
                fixation,
                values[fixation.name],
                _foot_impedance(values),
                (m.position - self.mean_angle, m.velocity),
                m.rate,
            )
            signals.move_foot(x + self.mean_angle, v, a)
            return
        length = next_fast_len(len(m.position) + int(m.rate), real=True)
        plate = self._known["plate"].of(
            length,
            lambda: [rfft(s - s.mean(), length) for s in (m.position, m.velocity, m.acceleration)],
        )
        gain = transmission(rfftfreq(length, 1.0 / m.rate), fixation, values)
        moved = [irfft(spectrum * gain, length)[: len(m.position)] for spectrum in plate]
        signals.move_foot(moved[0] + self.mean_angle, moved[1], moved[2])


def transmission(frequency: np.ndarray, fixation: CompliantCoupling, values: Values) -> np.ndarray:
    """Return the share of the plate's motion that reaches the foot, complex, at each frequency
    [Hz].
    """
    stiffness, damping = fixation.linearised(values[fixation.name])
    s = 2j * np.pi * frequency
    strap = stiffness + damping * s
    inertia, viscosity, spring = _foot_impedance(values)
    return strap / (strap + inertia * s**2 + viscosity * s + spring)


def _foot_impedance(values: Values) -> tuple[float, float, float]:
    """Return the inertia [kg.m^2], viscosity [N.m.s/rad] and stiffness [N.m/rad] of the foot."""
    # A joint need not have all three: an axis of a machine has no stiffness.
    inertia, viscosity, stiffness = (
        values.get(name, {}).get(symbol, 0.0)
        for name, symbol in (("inertia", "I"), ("viscosity", "B"), ("stiffness", "K"))
    )
    return inertia, viscosity, stiffness


def _transforms(term: Term) -> bool:
    return type(term).transform is not Term.transform or isinstance(term, CompliantCoupling)


def _past_straps(term: Term) -> bool:
    """Say whether the torque of a term has passed the straps already."""
    return term.place is Place.COUPLING or term.name in FOOT_IMPEDANCE
