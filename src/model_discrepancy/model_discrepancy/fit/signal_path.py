"""The terms of a model in the order of the signal path, and what the columns of each depend on."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.term import Place, Term
from model_discrepancy.fit.coupled_foot import Foot, Impedance

Values = Mapping[str, Mapping[str, float]]
Column = tuple[str, str]
# Torque per unit of each is the foot's acceleration, velocity and position.
FOOT_PARAMETERS: tuple[Column, ...] = (("inertia", "I"), ("viscosity", "B"), ("stiffness", "K"))
# Their torque on the foot's motion is the torque that the straps pass on.
FOOT_IMPEDANCE = frozenset(name for name, _ in FOOT_PARAMETERS)
# What changes the motion of plate or foot.
BEFORE_FOOT = (Place.ACTUATOR, Place.COUPLING)


@dataclass(frozen=True)
class Stage:
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
    impedes
        Whether it is a part of the foot's impedance.
    shaped
        Whether it sees the signals as the input of the reflex shapes them.
    """

    term: Term
    symbols: tuple[str, ...]
    moves_foot: bool
    place: Place
    transforms: bool
    has_columns: bool
    past_straps: bool
    impedes: bool
    shaped: bool

    @property
    def moves_plate(self) -> bool:
        """Tell whether it changes the motion that drives the straps."""
        return self.place in BEFORE_FOOT and self.transforms and not self.moves_foot

    @classmethod
    def of(cls, term: Term) -> Stage:
        """Describe a term."""
        moves_foot = isinstance(term, CompliantCoupling)
        return cls(
            term,
            tuple(p.symbol for p in term.parameters if moves_foot or not p.linear),
            moves_foot,
            term.place,
            transforms_signals(term),
            term.place is not Place.TORQUE_SENSOR and any(p.linear for p in term.parameters),
            has_passed_straps(term),
            term.name in FOOT_IMPEDANCE,
            term.place is Place.REFLEX_DYNAMICS,
        )

    def key(self, values: Values) -> tuple[Any, ...]:
        """Return all of these values that what the term does to a signal depends on."""
        name = self.term.name
        given = values[name]
        own = (name, *(given[symbol] for symbol in self.symbols))
        return (*own, *foot_impedance(values)) if self.moves_foot else own


@dataclass(frozen=True)
class Owner:
    """Holds a term that has columns, in its model, and what these depend on.

    Attributes
    ----------
    term
        The owner of the columns.
    stages, values
        Of the whole model, in the order of the signal path.
    foot
        Behind a compliant fixation; None without one.
    key
        All that its torque depends on.
    behind
        All that the filter between its torque and the reading depends on.
    path
        All that the signals before the joint depend on.
    past_straps
        Whether its torque has passed the straps already.
    impedes
        Whether it is a part of the foot's impedance.
    shaped
        Whether it sees the signals as the input of the reflex shapes them.
    """

    term: Term
    stages: Sequence[Stage]
    values: Values
    foot: Foot | None
    key: Hashable
    behind: Hashable
    path: Hashable
    past_straps: bool
    impedes: bool
    shaped: bool


def owners_of(stages: Sequence[Stage], values: Values, foot: Foot | None) -> list[Owner]:
    """Return the terms that have columns, in the order of the signal path.

    Parameters
    ----------
    stages, values
        Of the whole model, in the order of the signal path.
    foot
        Behind a compliant fixation; None without one.
    """
    keys = [stage.key(values) for stage in stages]
    coupling, shaping = (
        tuple(
            key
            for stage, key in zip(stages, keys, strict=True)
            if stage.place in places and stage.transforms
        )
        for places in (BEFORE_FOOT, (Place.REFLEX_INPUT,))
    )
    straps = tuple(stage.key(values) for stage in stages if stage.moves_foot)
    sensors = tuple(stage.key(values) for stage in stages if stage.place is Place.TORQUE_SENSOR)
    held = () if foot is None else (foot.number,)
    plate = tuple(stage.key(values) for stage in stages if stage.moves_plate)

    def moved(stage: Stage) -> tuple[Hashable, ...]:
        # Values that move the foot move what its own impedance makes; all else on the foot
        # sees it held, and what is on the plate does not see it.
        if stage.impedes:
            return (*coupling, *held)
        return plate if stage.past_straps else held or coupling

    return [
        Owner(
            stage.term,
            stages,
            values,
            foot,
            (key, moved(stage), shaping if stage.shaped else ()),
            (sensors,) if stage.past_straps else (sensors, straps, held),
            (stage.past_straps, moved(stage), shaping if stage.shaped else ()),
            stage.past_straps,
            stage.impedes,
            stage.shaped,
        )
        for stage, key in zip(stages, keys, strict=True)
        if stage.has_columns
    ]


def foot_impedance(values: Values) -> Impedance:
    """Return the inertia [kg.m^2], viscosity [N.m.s/rad] and stiffness [N.m/rad] of the foot."""
    # A joint need not have all three: an axis of a machine has no stiffness.
    inertia, viscosity, stiffness = (
        values.get(name, {}).get(symbol, 0.0) for name, symbol in FOOT_PARAMETERS
    )
    return inertia, viscosity, stiffness


def transforms_signals(term: Term) -> bool:
    """Say whether a term changes a signal on its way."""
    return type(term).transform is not Term.transform or isinstance(term, CompliantCoupling)


def has_passed_straps(term: Term) -> bool:
    """Say whether the torque of a term has passed the straps already."""
    return term.place is Place.COUPLING or term.name in FOOT_IMPEDANCE
