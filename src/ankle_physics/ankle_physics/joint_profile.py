"""What is usual for a joint: units, ranges of plausible values, and the base model.

Ranges of all terms are those of the human ankle. Another joint, or an axis of a machine, states how
much larger its torques and movements are, and all ranges follow; a linear axis states its units
too. A profile holds while it is in force::

    with JointProfile.load("wrist").in_force():
        diagnose(bag)
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from ankle_interfaces.suggestion import hint
from ankle_interfaces.yaml_text import YamlError, parse_yaml, read_text
from ankle_physics.errors import ModelError

_PAPER_TERMS = ("inertia", "viscosity", "stiffness", "reflex")
# N.m (torque), kg.m^2 (inertia: torque per rad/s^2) and rad, as units of terms are written.
_TORQUE = re.compile(r"^(N\.m|kg\.m\^2)")
_ANGLE = re.compile(r"(/?)rad(?:\^(\d))?")
UNIT_PAIRS = {("rad", "N.m"), ("m", "N")}
_LENGTHS = ("largest_range", "smallest_movement")
_NUMBERS = (*_LENGTHS, "torque_scale", "position_scale", "delay_scale")
_NUMBER_WORDS = "a finite number above 0"
_RANGE_WORDS = "two finite numbers above 0, the lower one first, such as [0.001, 0.2]"


@dataclass(frozen=True)
class JointProfile:
    """Describes a joint, or an axis of a machine.

    Attributes
    ----------
    name
        What messages call it.
    position_unit, torque_unit
        ``rad`` and ``N.m``, or ``m`` and ``N`` for a linear axis.
    inertia_range
        Plausible inertia [kg.m^2], or mass [kg] of a linear axis: lower and upper end. Outside of
        it a recording has a wrong unit or gain.
    largest_range
        Range of motion [rad or m].
    smallest_movement
        Rms of the movement [rad or m] below which it drowns in the noise of the position.
    torque_scale
        Torque, inertia and stiffness relative to a human ankle's [1]; the ranges of all terms
        follow.
    position_scale
        Movement relative to a human ankle's [1], in the units of the profile.
    delay_scale
        Shortest and usual reflex delay relative to a human ankle's [1].
    terms
        Names of the base model's terms.
    """

    name: str
    position_unit: str = "rad"
    torque_unit: str = "N.m"
    inertia_range: tuple[float, float] = (0.00125, 0.2)
    largest_range: float = 1.5
    smallest_movement: float = 5e-4
    torque_scale: float = 1.0
    position_scale: float = 1.0
    delay_scale: float = 1.0
    terms: tuple[str, ...] = _PAPER_TERMS

    def __post_init__(self) -> None:
        if (self.position_unit, self.torque_unit) not in UNIT_PAIRS:
            raise ModelError(
                f"joint: units {self.position_unit} and {self.torque_unit} do not belong together; "
                "allowed: rad with N.m, m with N"
            )
        low, high = self.inertia_range
        if not 0.0 < low < high < math.inf:
            raise ModelError(
                f"joint: inertia_range = {low:g} to {high:g}{self._unit_of('inertia_range')} is no "
                f"range above 0; allowed: {_RANGE_WORDS}"
            )
        for symbol in _NUMBERS:
            value = getattr(self, symbol)
            if not 0.0 < value < math.inf:
                raise ModelError(
                    f"joint: {symbol} = {value:g}{self._unit_of(symbol)} is not above 0; allowed: "
                    f"{_NUMBER_WORDS}"
                )
        if not self.terms:
            raise ModelError("joint: 'terms' names at least one term of the base model")
        twice = sorted({name for name in self.terms if self.terms.count(name) > 1})
        if twice:
            raise ModelError(f"joint: 'terms' names '{twice[0]}' more than once; allowed: once")

    def _unit_of(self, symbol: str) -> str:
        """Return the unit of an attribute as it stands behind a number; empty for a pure number."""
        if symbol == "inertia_range":
            return " kg" if self.linear else " kg.m^2"
        return f" {self.position_unit}" if symbol in _LENGTHS else ""

    @property
    def linear(self) -> bool:
        """Tell whether the joint moves along a line."""
        return self.position_unit == "m"

    @property
    def position_column(self) -> str:
        """Return the column of the position in a recording."""
        return f"position[{self.position_unit}]"

    @property
    def torque_column(self) -> str:
        """Return the column of the torque, or force, in a recording."""
        return "force[N]" if self.linear else "torque[N.m]"

    @property
    def velocity_column(self) -> str:
        """Return the column of the velocity in a recording."""
        return f"velocity[{self.position_unit}/s]"

    def scale(self, unit: str) -> float:
        """Return the ratio of a quantity of this unit, stated for an ankle, to this joint's.

        Parameters
        ----------
        unit
            As a term states it, ``N.m/rad``.
        """
        torque = 1 if _TORQUE.match(unit) else 0
        angle = -1 if unit.startswith("kg.m^2") else 0
        for slash, power in _ANGLE.findall(unit):
            angle += (-1 if slash else 1) * int(power or 1)
        return float(self.torque_scale**torque * self.position_scale**angle)

    def in_units(self, text: str) -> str:
        """Return a text with the units of an ankle written in this joint's."""
        if not self.linear:
            return text
        for old, new in (
            (r"kg[.·]m(\^2|²)", "kg"),
            (r"N[.·]m\b", "N"),
            (r"\bmrad\b", "mm"),
            (r"\brad\b", "m"),
        ):
            text = re.sub(old, new, text)
        return text

    @contextmanager
    def in_force(self) -> Iterator[None]:
        """Let ranges and units of all terms be this joint's."""
        token = _in_force.set(self)
        try:
            yield
        finally:
            _in_force.reset(token)

    @classmethod
    def load(cls, name_or_file: str | Path) -> JointProfile:
        """Return a profile by its name, or from a file.

        Raises
        ------
        ModelError
            No such name or file, or a file that states no profile.
        """
        if str(name_or_file) in PROFILES:
            return PROFILES[str(name_or_file)]
        path = Path(name_or_file)
        if not path.is_file():
            raise ModelError(
                f"joint '{name_or_file}' is neither a file nor one of {', '.join(PROFILES)}"
            )
        try:
            return cls.from_content(parse_yaml(read_text(path)))
        except (ModelError, YamlError) as error:
            raise ModelError(f"{path}: {error}") from None

    @classmethod
    def from_content(cls, content: Any) -> JointProfile:
        """Return the profile in the parsed content of a file.

        Raises
        ------
        ModelError
            As `load`.
        """
        if not isinstance(content, Mapping) or "joint" not in content:
            raise ModelError("a joint's file has 'joint: free text' and what differs from an ankle")
        given = dict(content)
        name = given.pop("joint")
        if isinstance(name, Mapping | list) or not str("" if name is None else name).strip():
            raise ModelError(f"joint: joint = {name!r} is no name; allowed: one line of free text")
        values: dict[str, Any] = {"name": str(name)}
        units = given.pop("units", {})
        if not isinstance(units, Mapping) or not set(units) <= {"position", "torque"}:
            raise ModelError(
                f"joint: units = {units!r} is refused; allowed: a table such as "
                "{position: m, torque: N}"
            )
        values |= {f"{key}_unit": str(unit) for key, unit in units.items()}
        known = {field.name for field in fields(cls)} - {"name", "position_unit", "torque_unit"}
        for key, value in given.items():
            if key not in known:
                raise ModelError(f"joint: unknown '{key}'; {hint(str(key), known | {'units'})}")
            values[key] = _read(key, value)
        profile = cls(**values)
        _require_known(profile.terms)
        return profile

    def content(self) -> dict[str, Any]:
        """Return plain data that `from_content` reads back to the same profile."""
        values = asdict(self)
        return {
            "joint": values.pop("name"),
            "units": {
                "position": values.pop("position_unit"),
                "torque": values.pop("torque_unit"),
            },
            **{key: list(v) if isinstance(v, tuple) else v for key, v in values.items()},
        }


def _read(key: str, value: Any) -> Any:
    """Return the value of an attribute in the shape that the profile holds.

    Parameters
    ----------
    key
        Of the attribute.
    value
        As the file states it.

    Raises
    ------
    ModelError
        Another shape than that of the attribute.
    """
    if key == "terms":
        if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
            raise ModelError(
                f"joint: terms = {value!r} cannot be read; allowed: a list of names such as "
                "[inertia, viscosity]"
            )
        return tuple(value)
    if key == "inertia_range":
        ends = [_number(end) for end in value] if isinstance(value, list | tuple) else []
        if len(ends) != 2 or None in ends:
            raise ModelError(
                f"joint: inertia_range = {value!r} cannot be read; allowed: {_RANGE_WORDS}"
            )
        return tuple(ends)
    number = _number(value)
    if number is None:
        raise ModelError(f"joint: {key} = {value!r} cannot be read; allowed: {_NUMBER_WORDS}")
    return number


def _number(value: Any) -> float | None:
    """Return a number, which YAML reads as a text where it is written as 1e-4; None for anything
    else.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        return float(value)
    except ValueError:
        return None


def _require_known(terms: Iterable[str]) -> None:
    """Refuse a base model with a term that the library lacks.

    Raises
    ------
    ModelError
        One of the names is unknown; has the one that may be meant.
    """
    # The library brings its ranges to the joint in force, and so imports this module.
    from ankle_physics.term import term_library

    known = term_library()
    for name in terms:
        if name not in known:
            raise ModelError(
                f"joint: 'terms' names '{name}', which is no term of the library; "
                f"{hint(name, known)} (a term of your own is read by --terms FOLDER)"
            )


ANKLE = JointProfile("ankle")
# Inertia about the joint of an adult (Winter, Biomechanics and Motor Control of Human Movement,
# 2009, table 4.1, 70 kg), a factor of four on either side; torque in proportion to inertia; delays
# by the length of the reflex arc (ankle 40 ms).
PROFILES: dict[str, JointProfile] = {
    "ankle": ANKLE,
    "knee": JointProfile(
        "knee",
        inertia_range=(0.05, 2.0),
        largest_range=2.6,
        torque_scale=25.0,
        delay_scale=0.65,
    ),
    "elbow": JointProfile(
        "elbow",
        inertia_range=(0.012, 0.5),
        largest_range=2.7,
        torque_scale=6.0,
        delay_scale=0.6,
    ),
    "wrist": JointProfile(
        "wrist",
        inertia_range=(0.0003, 0.02),
        largest_range=2.6,
        torque_scale=0.25,
        delay_scale=0.65,
    ),
}
_in_force: ContextVar[JointProfile] = ContextVar("joint_profile", default=ANKLE)


def joint_in_force() -> JointProfile:
    """Return the joint whose ranges and units hold now; the ankle's unless another was set."""
    return _in_force.get()
