"""A script of parameter changes while a simulation runs: jumps, ramps, sinusoids.

A scenario is a YAML file::

    scenario: stiffness and reflex gain jump     # free text
    changes:
      - at[s]: 0                                 # time since the first sample of the run
        stiffness.K[N.m/rad]: 50                 # term.parameter[unit]; jumps to 50
      - at[s]: 45
        over[s]: 5                               # a linear ramp of 5 s from the value at 45 s
        stiffness.K[N.m/rad]: 150
      - at[s]: 60
        voluntary_torque.level[N.m]:             # mean + amplitude * sin(2 pi frequency (t - at))
          mean: -5
          amplitude: 2
          frequency[Hz]: 0.1

Any linear parameter of any term can be scripted; it may change from sample to sample. Until its
first change a parameter has the model's value.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ankle_interfaces.yaml_text import YamlError, parse_yaml, read_text
from ankle_physics.errors import ModelError
from ankle_physics.model import Model
from ankle_physics.term import Parameter, term_library


@dataclass(frozen=True)
class Change:
    """Holds one entry of one parameter's script.

    Attributes
    ----------
    at
        [s] since the first sample.
    value
        That is reached, or the mean of a sinusoid, in the parameter's unit.
    over
        Duration of the ramp to `value` [s]; 0 is a jump.
    amplitude
        Of the sinusoid about `value`, in the parameter's unit; 0 is none.
    frequency
        Of the sinusoid [Hz].
    """

    at: float
    value: float
    over: float = 0.0
    amplitude: float = 0.0
    frequency: float = 0.0


class Track:
    """Lists the changes of one parameter in the order of their times."""

    def __init__(self, term: str, parameter: Parameter, changes: list[Change]) -> None:
        self.term = term
        self.parameter = parameter
        self.changes = changes

    @property
    def key(self) -> str:
        """Return the name in scenario files: ``stiffness.K[N.m/rad]``."""
        return f"{self.term}.{self.parameter.key}"

    def values(self, time: np.ndarray, before: float) -> np.ndarray:
        """Return values at times [s] of shape (n,), ascending; `before` holds until the first
        change.
        """
        out = np.full(len(time), before)
        start = before
        for index, change in enumerate(self.changes):
            end = self.changes[index + 1].at if index + 1 < len(self.changes) else math.inf
            if time[-1] >= change.at and time[0] < end:
                within = slice(
                    int(np.searchsorted(time, change.at)), int(np.searchsorted(time, end))
                )
                out[within] = _course(change, start, time[within])
            start = (
                float(_course(change, start, np.array([end]))[0]) if math.isfinite(end) else start
            )
        return out


def _course(change: Change, start: float, time: np.ndarray) -> np.ndarray:
    since = time - change.at
    if change.amplitude:
        return change.value + change.amplitude * np.sin(2.0 * math.pi * change.frequency * since)
    if change.over:
        return start + (change.value - start) * np.minimum(since / change.over, 1.0)
    return np.full(len(time), change.value)


class Scenario:
    """Holds the changes of several parameters over time."""

    def __init__(self, tracks: list[Track], title: str = "") -> None:
        self.tracks = tracks
        self.title = title

    @classmethod
    def load(cls, path: str | Path) -> Scenario:
        """Read a scenario file.

        Raises
        ------
        ModelError
            Not a scenario, unknown term or parameter, wrong unit, value out of range; names file,
            change, key.
        OSError
            The file cannot be read.
        """
        try:
            return cls.from_content(parse_yaml(read_text(path, "scenario file")))
        except (ModelError, YamlError) as error:
            raise ModelError(f"{path}: {error}") from None

    @classmethod
    def from_content(cls, content: Any) -> Scenario:
        """Return the scenario in the parsed content of a scenario file.

        Raises
        ------
        ModelError
            As `load`.
        """
        if not isinstance(content, dict) or not isinstance(content.get("changes"), list):
            raise ModelError("a scenario file has 'scenario: free text' and a list 'changes'")
        tracks: dict[str, Track] = {}
        for number, item in enumerate(content["changes"], 1):
            where = f"change {number}"
            if not isinstance(item, dict) or "at[s]" not in item:
                raise ModelError(f"{where}: lacks its time 'at[s]'")
            at = _number(item["at[s]"], f"{where}: at[s]", "s", 0.0, math.inf)
            over = _number(item.get("over[s]", 0.0), f"{where}: over[s]", "s", 0.0, math.inf)
            for key in item:
                if key in ("at[s]", "over[s]"):
                    continue
                term, parameter = _find(str(key), where)
                track = tracks.setdefault(str(key), Track(term, parameter, []))
                if track.changes and at <= track.changes[-1].at:
                    raise ModelError(
                        f"{where}: {key} at {at:g} s does not come after its change at "
                        f"{track.changes[-1].at:g} s"
                    )
                track.changes.append(_change(item[key], at, over, parameter, f"{where}: {key}"))
        return cls(list(tracks.values()), str(content.get("scenario", "")))

    def require(self, model: Model) -> None:
        """Check that the model has every term that is scripted.

        Raises
        ------
        ModelError
            Names the missing term and the key.
        """
        for track in self.tracks:
            if not model.has(track.term):
                raise ModelError(
                    f"the scenario changes {track.key}, but the model has no term '{track.term}'"
                )

    def require_free(self, term: str, symbol: str) -> None:
        """Check that a parameter is not scripted, so that it can be set by hand.

        Raises
        ------
        ModelError
            It is.
        """
        if any(track.term == term and track.parameter.symbol == symbol for track in self.tracks):
            raise ModelError(
                f"{term}: {symbol} is scripted by the scenario and cannot be set by hand"
            )


def _find(key: str, where: str) -> tuple[str, Parameter]:
    library = term_library()
    name, _, rest = key.partition(".")
    if name not in library:
        raise ModelError(
            f"{where}: unknown key '{key}'; expected at[s], over[s] or 'term.parameter[unit]' as "
            "in 'stiffness.K[N.m/rad]'"
        )
    linear = [parameter for parameter in library[name].parameters if parameter.linear]
    for parameter in linear:
        if parameter.key == rest:
            return name, parameter
    can = ", ".join(f"{name}.{parameter.key}" for parameter in linear) or "none"
    raise ModelError(f"{where}: '{key}' cannot be scripted; parameters of '{name}' that can: {can}")


def _change(given: Any, at: float, over: float, parameter: Parameter, what: str) -> Change:
    if not isinstance(given, dict):
        return Change(
            at, _number(given, what, parameter.unit, parameter.lower, parameter.upper), over
        )
    unknown = sorted(set(given) - {"mean", "amplitude", "frequency[Hz]"})
    if unknown or len(given) < 3:
        raise ModelError(
            f"{what}: a sinusoid has 'mean', 'amplitude' and 'frequency[Hz]'; found "
            f"{', '.join(map(str, given))}"
        )
    if over:
        raise ModelError(f"{what}: a sinusoid cannot be reached over a ramp; leave out over[s]")
    mean = _number(given["mean"], f"{what}: mean", parameter.unit, parameter.lower, parameter.upper)
    most = min(mean - parameter.lower, parameter.upper - mean)
    amplitude = _number(given["amplitude"], f"{what}: amplitude", parameter.unit, 0.0, most)
    frequency = _number(given["frequency[Hz]"], f"{what}: frequency[Hz]", "Hz", 0.0, 100.0)
    return Change(at, mean, 0.0, amplitude, frequency)


def _number(given: Any, what: str, unit: str, lower: float, upper: float) -> float:
    number = (
        float(given)
        if isinstance(given, (int, float)) and not isinstance(given, bool)
        else math.nan
    )
    if not (lower <= number <= upper and math.isfinite(number)):
        raise ModelError(f"{what} = {given} {unit} is outside {lower:g} to {upper:g} {unit}")
    return number
