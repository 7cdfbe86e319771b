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

from collections import OrderedDict
from collections.abc import Mapping, Sequence
from copy import copy
from typing import Any

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.foot_motion import foot_motion
from ankle_physics.joint_profile import joint_in_force
from ankle_physics.signals import Signals
from ankle_physics.term import PATH, Place, Term, term_library
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.fit.rows import Rows
from model_discrepancy.recording.motion import Motion

Values = Mapping[str, Mapping[str, float]]
Column = tuple[str, str]
# They act on the foot's motion, H times the plate's, so that their torque has passed the straps
# already.
FOOT_IMPEDANCE = frozenset({"inertia", "viscosity", "stiffness"})
# Gradients need a handful of neighbours of the current point; a spectrum takes 0.1 to 0.2 MB.
_CACHE_SIZE = 8


class Columns:
    """Computes columns for one recording; remembers what did not change since the last calls.

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
        self.target = rows.spectrum(motion.torque)
        self._known: dict[str, OrderedDict[Any, Any]] = {}

    def convention(self, name: str) -> dict[str, float]:
        """Return the values of the parameters that are not fitted: angles at the recording's mean,
        all else typical.
        """
        return {
            p.symbol: self.mean_angle if p.unit == joint_in_force().position_unit else p.default
            for p in term_library()[name].parameters
            if not p.fitted and not p.linear
        }

    def spectra(self, values: Values) -> dict[Column, np.ndarray]:
        """Return the spectrum of each column of the model with these terms and values, by (term,
        symbol).
        """
        terms = sorted(
            (term_library()[name]() for name in values), key=lambda term: PATH.index(term.place)
        )
        coupling = tuple(
            _key(t, values) for t in terms if t.place is Place.COUPLING and _transforms(t)
        )
        shaping = tuple(
            _key(t, values) for t in terms if t.place is Place.REFLEX_INPUT and _transforms(t)
        )
        sensor = tuple(_key(t, values) for t in terms if t.place is Place.TORQUE_SENSOR)
        found: dict[Column, np.ndarray] = {}
        for term in terms:
            if term.place is Place.TORQUE_SENSOR or not any(p.linear for p in term.parameters):
                continue
            key = (
                _key(term, values),
                coupling,
                shaping if term.place is Place.REFLEX_DYNAMICS else (),
            )
            own = self._remember(
                term.name,
                (key, sensor),
                lambda term=term, key=key: self._sensed(
                    term,
                    terms,
                    values,
                    self._remember(
                        "at " + term.name,
                        key,
                        lambda: self._columns(term, terms, values, coupling, shaping),
                    ),
                ),
            )
            for symbol, spectrum in own.items():
                found[term.name, symbol] = spectrum
        return found

    def _sensed(
        self, term: Term, terms: Sequence[Term], values: Values, own: Mapping[str, np.ndarray]
    ) -> Mapping[str, np.ndarray]:
        """Return the columns of one term as the torque sensor reports them."""
        key = (
            "filter",
            term.place is Place.COUPLING or term.name in FOOT_IMPEDANCE,
            tuple(
                _key(t, values)
                for t in terms
                if t.place is Place.TORQUE_SENSOR or isinstance(t, CompliantCoupling)
            ),
        )
        gain = self._remember("filter", key, lambda: self._filter(term, terms, values))
        return (
            own if gain is None else {symbol: gain * spectrum for symbol, spectrum in own.items()}
        )

    def _filter(self, term: Term, terms: Sequence[Term], values: Values) -> np.ndarray | None:
        """Return the filter between a term's torque and the reading; None for nothing.

        It holds the straps, for what acts on the foot, and the sensor.
        """
        filters = []
        for other in terms:
            if (
                isinstance(other, CompliantCoupling)
                and term.place is not Place.COUPLING
                and term.name not in FOOT_IMPEDANCE
            ):
                filters.append(transmission(self.rows.frequency, other, values))
            elif other.place is Place.TORQUE_SENSOR:
                response = other.response(self.rows.frequency, values[other.name])
                if response is None:
                    raise DiagnosisError(
                        f"{other.name} acts at the torque sensor and states no frequency response"
                    )
                filters.append(response)
        return np.prod(filters, axis=0) if filters else None

    def _columns(
        self, term: Term, terms: Sequence[Term], values: Values, coupling: Any, shaping: Any
    ) -> dict[str, np.ndarray]:
        signals = self._remember("path", (coupling, shaping), lambda: self._path(terms, values))
        state = term.start(self.motion.rate)
        torques = term.torque(copy(signals), values[term.name], state)
        return {symbol: self.rows.spectrum(column) for symbol, column in torques.items()}

    def _path(self, terms: Sequence[Term], values: Values) -> Signals:
        m = self.motion
        signals = Signals(m.rate, m.position, m.velocity, m.acceleration, m.activation)
        for term in terms:
            if isinstance(term, CompliantCoupling):
                self._move_foot(signals, term, values)
            elif term.place in (Place.COUPLING, Place.REFLEX_INPUT) and _transforms(term):
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
        plate = self._remember(
            "plate",
            length,
            lambda: [rfft(s - s.mean(), length) for s in (m.position, m.velocity, m.acceleration)],
        )
        gain = transmission(rfftfreq(length, 1.0 / m.rate), fixation, values)
        moved = [irfft(spectrum * gain, length)[: len(m.position)] for spectrum in plate]
        signals.move_foot(moved[0] + self.mean_angle, moved[1], moved[2])

    def _remember(self, name: str, key: Any, make: Any) -> Any:
        known = self._known.setdefault(name, OrderedDict())
        if key in known:
            known.move_to_end(key)
            return known[key]
        known[key] = value = make()
        if len(known) > _CACHE_SIZE:
            known.popitem(last=False)
        return value


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


def _key(term: Term, values: Values) -> tuple[Any, ...]:
    given = values[term.name]
    if isinstance(term, CompliantCoupling):
        return (term.name, *given.values(), *_foot_impedance(values))
    return (term.name, *(given[p.symbol] for p in term.parameters if not p.linear))
