"""A term of the joint model is one physical effect: equation, parameters and place.

A model is a list of terms. Each term is one file in `ankle_physics.terms` with one subclass of
`Term`; putting the file there is all that is needed for simulation, fitting, search and
documentation to know it.

A term acts in one of two ways:

- `torque` returns columns, one for each of its linear parameters; the model adds
  ``value * column`` to the torque. Fitting solves for these values directly (variable projection),
  and a linear parameter may change from sample to sample.
- `transform` changes a signal on the way (foot motion, reflex drive, measured torque or position).

Both work stretch by stretch with the state that `start` made, so that the same code runs online in
blocks of 32 samples and offline on a whole recording, with the same result.
"""

from __future__ import annotations

import importlib
import pkgutil
import sys
from abc import ABC
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import Enum
from functools import cache
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Quantity
from ankle_physics.errors import ModelError
from ankle_physics.joint_profile import ANKLE, JointProfile, joint_in_force
from ankle_physics.signals import Signals

Values = Mapping[str, Any]
"""Values of a term, by symbol."""
ModelValues = dict[str, dict[str, float]]
"""Values of all terms of a model, by term and symbol."""
State = dict[str, Any]


class Place(Enum):
    """Lists where in the signal path a term acts, in the order of the path."""

    ACTUATOR = "actuator and reference"
    COUPLING = "coupling between footplate and foot"
    ACTIVATION = "activation"
    INTRINSIC = "intrinsic"
    REFLEX_INPUT = "reflex input"
    REFLEX_DYNAMICS = "reflex dynamics"
    TORQUE_SENSOR = "torque sensor"
    POSITION_SENSOR = "position sensor"


PATH = tuple(Place)
REFLEX_PLACES = (Place.REFLEX_INPUT, Place.REFLEX_DYNAMICS)
"""Terms of these places answer a movement that is over."""


class Owner(Enum):
    """Says whether an effect belongs to the rig, which keeps it, or to the subject."""

    RIG = "rig"
    SUBJECT = "subject"


# What sits in the drive or in a sensor is the rig's. What acts at the coupling is the subject's,
# who is strapped in anew in each session, unless a term states otherwise.
_RIG_PLACES = (Place.ACTUATOR, Place.TORQUE_SENSOR, Place.POSITION_SENSOR)


@dataclass(frozen=True)
class Parameter(Quantity):
    """Describes one parameter of a term: a `Quantity` with its role in the model.

    Its description says what it is among the parameters of its term. Where an own term gives none,
    nodes show the sentence of the term.

    Attributes
    ----------
    default
        Where a search starts, and what a simulation takes unless a value is given.
    linear
        Whether the torque is proportional to it (then `Term.torque` returns its column).
    fitted
        False for a convention, as the angle about which a curve is written; whoever fits sets it
        (an angle: to the mean angle of the recording) and leaves it.
    tried
        Values at which a search tries the term, where some spread evenly over the range do not
        suit; empty: those.
    limit_case
        ``lower`` or ``upper``: the end of the range at which the term has become as simple as it
        can be, such as bonds that do not attach anew. A fit that ends there says nothing against
        the term.
    """

    default: float = 0.0
    linear: bool = False
    fitted: bool = True
    tried: tuple[float, ...] = ()
    limit_case: str = ""

    def value(self, value: object, term: str) -> float:
        """Return the value of this parameter in a model as a float.

        Parameters
        ----------
        value
            A number, or a text that reads as one.
        term
            Name of the term, for the error.

        Raises
        ------
        ModelError
            Not a finite number, or outside the range.
        """
        with suppress(TypeError, ValueError):
            value = float(value)  # type: ignore[arg-type]
        try:
            return float(replace(self, symbol=f"{term}.{self.symbol}").check(value))
        except QuantityError as error:
            raise ModelError(str(error)) from None

    def for_joint(self, joint: JointProfile) -> Parameter:
        """Return the parameter with the range, the typical value and the unit of a joint."""
        factor = joint.scale(self.unit)
        shortest = joint.delay_scale if self.symbol == "delay" else 1.0
        return replace(
            self,
            unit=joint.in_units(self.unit),
            lower=self.lower * factor * min(shortest, 1.0),
            upper=self.upper * factor * max(shortest, 1.0),
            default=self.default * factor * shortest,
            tried=tuple(value * factor for value in self.tried),
        )


class Turn(NamedTuple):
    """Holds the sentences of a term on either side of a parameter's neutral value."""

    symbol: str
    neutral: float
    below: str
    above: str


class Term(ABC):
    """Describes one physical effect.

    Subclasses state the class attributes and override what they do.

    Attributes
    ----------
    name
        As in model files, ``maxwell_relaxation``.
    place
        Where in the signal path it acts.
    sentence
        One sentence in plain words that says what it is.
    parameters
        All of them, linear and not.
    turn
        Where the sentence depends on the direction of the effect; else None.
    belongs_to
        Rig or subject; follows from the place where a term does not state it.
    has_memory
        Whether the torque of an intrinsic term depends on the movement before: relaxation,
        hysteresis, short-range stiffness. Such torque is no part of the stiffness K.
    family
        Terms of one signature, which one recording can hardly tell apart; empty where the
        term is a family of its own.
    separated_by
        The measurement that tells this term from others of its family.
    searched
        False where no recording tells the term from the base model, or no movement causes its
        torque: a diagnosis does not look for it. Nor does it search for a flexible term.
    flexible
        Whether it takes so many shapes that it would stand in for other terms. A diagnosis tries it
        after its search, and only beside several terms, where no equation is exact.
    follows_torque
        Whether it follows the slow torque of the recording, and so the very noise that it explains.
    follows_time
        Whether it follows the time since the recording began. Another recording has another course,
        and of a drift one half of a recording does not tell of the other.
    rest_torque
        Symbol of a torque [N.m] that may be held at rest, where the equation gives none: dry
        friction carries a part of what a spring would. Empty where there is none.
    companions
        Terms that come with this one and can be told from the base model only beside it.
    turned_by
        Term that frees how this one turns, which is faster than a recording tells. It joins a model
        once this one is in it, and leaves with it. Empty where there is none.
    generalises
        Terms that are special cases of this one. It fits at least as well as they do by having more
        parameters, so it is chosen only where it does better than chance beyond them.
    usual
        Whether every rig with a person in it has this effect to some degree. Where a recording
        needs several terms, so that no equation is exact, and terms fit it about equally well, a
        usual one is more probable than the others.
    rings
        Whether it may be a light vibration: from another frequency a fit ends elsewhere, so that a
        search begins at several.
    imitates
        Whether it has stood in for other physics where nothing stood against it, so that no
        recording by itself makes its name sure.
    of_joint
        Name of the joint to which ranges and units were brought; empty for the ankle's, as written.
    resolved_by_duration
        Symbol of a frequency that a recording of duration T tells from its neighbours 1/T away: a
        search tries as many values; empty where there is none.
    """

    name: ClassVar[str]
    place: ClassVar[Place]
    sentence: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]
    turn: ClassVar[Turn | None] = None
    belongs_to: ClassVar[Owner] = Owner.SUBJECT
    has_memory: ClassVar[bool] = False
    family: ClassVar[str] = ""
    separated_by: ClassVar[str] = ""
    searched: ClassVar[bool] = True
    flexible: ClassVar[bool] = False
    companions: ClassVar[tuple[str, ...]] = ()
    follows_torque: ClassVar[bool] = False
    follows_time: ClassVar[bool] = False
    rest_torque: ClassVar[str] = ""
    turned_by: ClassVar[str] = ""
    generalises: ClassVar[tuple[str, ...]] = ()
    resolved_by_duration: ClassVar[str] = ""
    usual: ClassVar[bool] = False
    rings: ClassVar[bool] = False
    imitates: ClassVar[bool] = False
    of_joint: ClassVar[str] = ""

    def __init_subclass__(cls, **options: Any) -> None:
        """Set the owner of a term by its place where the class does not state it."""
        super().__init_subclass__(**options)
        if "place" in vars(cls) and "belongs_to" not in vars(cls):
            cls.belongs_to = Owner.RIG if cls.place in _RIG_PLACES else Owner.SUBJECT

    @classmethod
    def sentence_for(cls, values: Values) -> str:
        """Return the sentence that fits these values."""
        if cls.turn is None:
            return cls.sentence
        return (
            cls.turn.below if float(values[cls.turn.symbol]) < cls.turn.neutral else cls.turn.above
        )

    def start(self, rate: float, seed: int = 0) -> State:
        """Make the state for a run at `rate` [Hz]; `seed` matters to terms that draw numbers."""
        return {}

    def transform(self, signals: Signals, values: Values, state: State) -> None:
        """Change a signal of the path in place."""

    def response(self, frequency: np.ndarray, values: Values) -> np.ndarray | None:
        """Return the frequency response of a linear filter on the measured torque, complex, at each
        frequency [Hz].

        Terms at the torque sensor state it beside `transform`, so that a fit can apply it to each
        column's spectrum; None for all others.
        """
        return None

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        """Return the torque per unit of each linear parameter, each of shape (n,), keyed by
        symbol.
        """
        return {}

    @classmethod
    def drag(cls, values: Values, velocity: float) -> float:
        """Return by how much the torque grows with the plate's velocity [rad/s] around one
        [N.m.s/rad], where it grows so steeply that a simulation of the plate has to know; 0 for
        most terms.
        """
        return 0.0

    @classmethod
    def imitated_by(cls, model: Mapping[str, Values]) -> dict[str, ModelValues]:
        """Return how other terms make nearly the torque of this one: for each of them, by its name,
        the values of a model, by term and symbol. A fit with such a term begins there.

        Parameters
        ----------
        model
            Values of a model that holds this term, by term.
        """
        return {}

    @classmethod
    def begins_beside(cls, model: Mapping[str, Values]) -> list[ModelValues]:
        """Return where a fit with this term begins, too, each by term and symbol: where other terms
        of a model have bent to take the place of this one, a fit from there may not find back.

        Parameters
        ----------
        model
            Values of a model that lacks this term, by term.
        """
        return []

    @classmethod
    def parameter(cls, symbol: str) -> Parameter:
        """Return one parameter by its symbol.

        Raises
        ------
        ModelError
            No such parameter.
        """
        for parameter in cls.parameters:
            if parameter.symbol == symbol:
                return parameter
        known = ", ".join(parameter.symbol for parameter in cls.parameters) or "none"
        raise ModelError(f"{cls.name}: no parameter '{symbol}'; it has {known}")


def term_library() -> dict[str, type[Term]]:
    """Return every term by its name: those in `ankle_physics.terms` and one's own.

    Their ranges and units are those of the joint in force.
    """
    return _library_of(joint_in_force())


def forget_library() -> None:
    """Let the next call of `term_library` look for terms again."""
    _library_of.cache_clear()


@cache
def _library_of(joint: JointProfile) -> dict[str, type[Term]]:
    import ankle_physics.terms as package

    for module in pkgutil.iter_modules(package.__path__):
        importlib.import_module(f"{package.__name__}.{module.name}")
    # A class whose module was refused is still a subclass, but its module is gone.
    found = {
        term.name: term
        for term in _subclasses(Term)
        if hasattr(term, "name") and term.__module__ in sys.modules and not term.of_joint
    }
    return {name: _for_joint(found[name], joint) for name in sorted(found)}


def _for_joint(term: type[Term], joint: JointProfile) -> type[Term]:
    """Return the term with the ranges and units of a joint."""
    if joint == ANKLE:
        return term
    parameters = tuple(parameter.for_joint(joint) for parameter in term.parameters)
    attributes = {
        "parameters": parameters,
        "of_joint": joint.name,
        "__doc__": term.__doc__,
        "__module__": term.__module__,
    }
    return type(term.__name__, (term,), attributes)


def _subclasses(parent: type[Term]) -> list[type[Term]]:
    direct = parent.__subclasses__()
    return direct + [term for child in direct for term in _subclasses(child)]
