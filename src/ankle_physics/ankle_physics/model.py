"""A joint model: a list of terms with their parameter values, read from and written to YAML.

See `ankle_physics.term` for what a term is. The paper's model is
``[inertia, viscosity, stiffness, reflex]`` (van 't Veld et al. 2018, figure 1).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from ankle_interfaces.yaml_text import YamlError, parse_yaml, read_text
from ankle_physics.errors import ModelError
from ankle_physics.foot_loop import TOLERANCE
from ankle_physics.joint_profile import ANKLE, JointProfile, joint_in_force
from ankle_physics.model_run import ModelRun
from ankle_physics.signals import Signals
from ankle_physics.term import PATH, Term, term_library

PAPER_TERMS = ("inertia", "viscosity", "stiffness", "reflex")
# What a fit states of the whole joint, and the term of the paper's model whose unit it has.
TERMS_OF_GAINS = {"K": "stiffness", "G": "reflex"}


class StatedValue(NamedTuple):
    """Holds what a fit states of the whole joint at the recording's operating point.

    Attributes
    ----------
    value
        Of K [N.m/rad] or G [N.m.s/rad].
    standard_error
        In the same unit, with what the value owes to the choice of terms.
    """

    value: float
    standard_error: float


@dataclass(frozen=True)
class StatedAt:
    """Describes where the values of a fit are stated.

    Attributes
    ----------
    position, torque
        Means over the recording [rad], [N.m].
    time
        Its middle [s].
    """

    position: float
    torque: float
    time: float


# Keys in a model file.
_STATED_AT = {"position[rad]": "position", "torque[N.m]": "torque", "time[s]": "time"}


@dataclass
class Entry:
    """Holds a term in a model.

    Attributes
    ----------
    term
        The effect.
    values
        Every parameter of the term by symbol; an array of shape (n,) is allowed for a linear
        parameter while a stretch of n samples is simulated.
    standard_errors
        By symbol, where a fit gave them.
    tracked
        Whether the values follow the subject from moment to moment, so that an online estimator
        goes on estimating them instead of holding them.
    """

    term: Term
    values: dict[str, Any]
    standard_errors: dict[str, float] = field(default_factory=dict)
    tracked: bool = False


class Model:
    """Holds terms with values, in the order of the signal path.

    Parameters
    ----------
    entries
        At most one of each term.
    title
        Free text that describes the model.
    stated
        K and G of the whole joint with their standard errors, where a fit gave them; None: none.
    stated_at
        Where they are stated; None: nobody knows.

    Attributes
    ----------
    joint
        Whose ranges and units the terms have: the joint in force when the model was made.

    Raises
    ------
    ModelError
        A term twice.
    """

    def __init__(
        self,
        entries: list[Entry],
        title: str = "",
        stated: Mapping[str, StatedValue] | None = None,
        stated_at: StatedAt | None = None,
    ) -> None:
        names = [entry.term.name for entry in entries]
        for name in names:
            if names.count(name) > 1:
                raise ModelError(
                    f"term '{name}' appears {names.count(name)} times; each term can be in a "
                    "model once"
                )
        self.title = title
        self.stated = dict(stated or {})
        self.stated_at = stated_at
        self.joint = joint_in_force()
        self.entries = sorted(entries, key=lambda entry: PATH.index(entry.term.place))

    @classmethod
    def of(cls, values: Mapping[str, Mapping[str, float]] | None = None, title: str = "") -> Model:
        """Return a model from ``{term: {symbol: value}}``; None is the paper's model.

        What is not given is typical.

        Raises
        ------
        ModelError
            Unknown term or symbol, or a value out of range.
        """
        wanted = {name: {} for name in PAPER_TERMS} if values is None else values
        return cls([_entry(name, dict(given)) for name, given in wanted.items()], title)

    @classmethod
    def load(cls, path: str | Path) -> Model:
        """Read a model file.

        Raises
        ------
        ModelError
            Not a model file, unknown term or parameter, wrong unit, value out of range; names the
            file.
        OSError
            The file cannot be read.
        """
        try:
            return cls.from_text(read_text(path, "model file"))
        except (ModelError, YamlError) as error:
            raise ModelError(f"{path}: {error}") from None

    @classmethod
    def from_text(cls, text: str) -> Model:
        """Read the text of a model file.

        Raises
        ------
        ModelError
            As `load`, without the file's name.
        """
        try:
            return cls.from_content(parse_yaml(text))
        except YamlError as error:
            raise ModelError(str(error)) from None

    @classmethod
    def from_content(cls, content: Any) -> Model:
        """Return the model in the parsed content of a model file.

        Raises
        ------
        ModelError
            As `load`.
        """
        if not isinstance(content, dict) or not isinstance(content.get("terms"), list):
            raise ModelError("a model file has 'model: free text' and a list 'terms'")
        if "joint" in content:
            with JointProfile.from_content(content["joint"]).in_force():
                return cls._with_terms(content)
        return cls._with_terms(content)

    @classmethod
    def _with_terms(cls, content: dict[str, Any]) -> Model:
        """Return the model in a file's content, by the ranges and units in force."""
        entries = []
        for item in content["terms"]:
            if not isinstance(item, dict) or "term" not in item:
                raise ModelError(f"each entry of 'terms' names its 'term'; found {item!r}")
            given, errors = {}, {}
            name = item["term"]
            term = _find(name)
            for key, value in item.items():
                if key in ("term", "tracked"):
                    continue
                parameter = next((p for p in term.parameters if p.key == key), None)
                if parameter is None:
                    known = ", ".join(p.key for p in term.parameters)
                    raise ModelError(f"{name}: unknown parameter '{key}'; it has {known}")
                if isinstance(value, dict):
                    if "standard_error" in value:
                        errors[parameter.symbol] = _error(value["standard_error"], name, key)
                    value = value.get("value")
                given[parameter.symbol] = value
            entry = _entry(name, given)
            entry.standard_errors = errors
            entry.tracked = _flag(item.get("tracked", False), name)
            entries.append(entry)
        return cls(
            entries,
            str(content.get("model", "")),
            _stated(content.get("impedance", {})),
            _stated_at(content["impedance_at"]) if "impedance_at" in content else None,
        )

    def save(self, path: str | Path) -> None:
        """Write a model file that `load` reads back to the same values."""
        Path(path).write_text(self.text())

    def text(self) -> str:
        """Return the text of the model file, which `from_text` reads back to the same values."""
        content: dict[str, Any] = {"model": self.title}
        if self.joint != ANKLE:
            content["joint"] = self.joint.content()
        content["terms"] = self.content()
        if self.stated:
            content["impedance"] = {
                _stated_key(symbol): {"value": s.value, "standard_error": s.standard_error}
                for symbol, s in self.stated.items()
            }
        if self.stated_at is not None:
            content["impedance_at"] = {
                key: float(getattr(self.stated_at, name)) for key, name in _STATED_AT.items()
            }
        return yaml.safe_dump(content, sort_keys=False)

    @property
    def sha256(self) -> str:
        """Return the SHA-256 of the terms, by which estimates state the model that they are made
        with.
        """
        return sha256(yaml.safe_dump(self.content()).encode()).hexdigest()

    def content(self) -> list[dict[str, Any]]:
        """Return the list 'terms' of a model file."""
        terms = []
        for entry in self.entries:
            item: dict[str, Any] = {"term": entry.term.name}
            for parameter in entry.term.parameters:
                value = float(entry.values[parameter.symbol])
                error = entry.standard_errors.get(parameter.symbol)
                item[parameter.key] = (
                    value if error is None else {"value": value, "standard_error": float(error)}
                )
            if entry.tracked:
                item["tracked"] = True
            terms.append(item)
        return terms

    def entry(self, name: str) -> Entry:
        """Return one term of the model.

        Raises
        ------
        ModelError
            The model lacks it.
        """
        for entry in self.entries:
            if entry.term.name == name:
                return entry
        raise ModelError(
            f"the model has no term '{name}'; it has "
            f"{', '.join(entry.term.name for entry in self.entries)}"
        )

    def has(self, name: str) -> bool:
        """Say whether the model has the term."""
        return any(entry.term.name == name for entry in self.entries)

    def start(self, rate: float, seed: int = 0, tolerance: float = TOLERANCE) -> ModelRun:
        """Begin a run at `rate` [Hz].

        Parameters
        ----------
        rate
            Sampling rate [Hz].
        seed
            Of the terms that draw random numbers.
        tolerance
            To which the torque on a foot behind a compliant coupling is solved, as a share of it.
        """
        return ModelRun(self, rate, seed, tolerance)

    def torque(self, signals: Signals) -> np.ndarray:
        """Return the torque [N.m] of shape (n,) over a whole stretch, from rest."""
        return self.start(signals.rate).torque(signals)


def _error(value: object, name: str, key: str) -> float:
    """Return a standard error of a file as a number."""
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise ModelError(
            f"{name}: the standard_error of '{key}' = {value!r} is refused; expected a number"
        ) from None


def _flag(value: Any, term: str) -> bool:
    if not isinstance(value, bool):
        raise ModelError(f"{term}: tracked = {value!r} is neither true nor false")
    return value


def _stated_key(symbol: str) -> str:
    return _find(TERMS_OF_GAINS[symbol]).parameter(symbol).key


def _stated(content: Any) -> dict[str, StatedValue]:
    """Return the values under 'impedance' of a model file."""
    symbols = {_stated_key(symbol): symbol for symbol in TERMS_OF_GAINS}
    if not isinstance(content, dict):
        raise ModelError(f"'impedance' names {', '.join(symbols)}; found {content!r}")
    found = {}
    for key, given in content.items():
        if key not in symbols:
            raise ModelError(f"impedance: unknown value '{key}'; allowed: {', '.join(symbols)}")
        try:
            stated = StatedValue(float(given["value"]), float(given["standard_error"]))
        except (KeyError, TypeError, ValueError):
            raise ModelError(f"impedance: {key} has 'value' and 'standard_error'") from None
        if not (np.isfinite(stated.value) and 0.0 <= stated.standard_error < np.inf):
            raise ModelError(
                f"impedance: {key} = {stated.value:g} with standard error "
                f"{stated.standard_error:g} is refused; allowed: finite, error not below 0"
            )
        found[symbols[key]] = stated
    return found


def _stated_at(content: Any) -> StatedAt:
    """Return the values under 'impedance_at' of a model file."""
    try:
        values = {name: float(content[key]) for key, name in _STATED_AT.items()}
    except (KeyError, TypeError, ValueError):
        values = {}
    if not values or not np.all(np.isfinite(list(values.values()))):
        raise ModelError(
            f"'impedance_at' has finite {', '.join(_STATED_AT)}; found {content!r}"
        ) from None
    return StatedAt(**values)


def _find(name: str) -> type[Term]:
    library = term_library()
    if not isinstance(name, str) or name not in library:
        raise ModelError(f"unknown term '{name}'; known: {', '.join(library)}")
    return library[name]


def _entry(name: str, given: dict[str, Any]) -> Entry:
    term = _find(name)
    for symbol in given:
        term.parameter(symbol)
    values = {p.symbol: p.value(given.get(p.symbol, p.default), name) for p in term.parameters}
    return Entry(term(), values)
