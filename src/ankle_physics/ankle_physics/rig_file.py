"""The file ``rig.yaml`` holds a calibrated rig: delays, zeros, noise and the rig's terms.

A value that was measured has a standard error. ``docs/calibration.md`` shows a whole file::

    rig: laboratory 2, plate B
    calibrated: 2026-11-20T14:02:11Z
    bag: rig_20261120
    bag_sha256: 3f...
    torque_delay[s]: {value: 0.00049, standard_error: 0.00002}
    velocity_delay[s]: {value: 0.0, standard_error: 0.00003}
    zero: {"position[rad]": 0.012, "torque[N.m]": -0.31}
    noise: {"position[rad]": 4.5e-5, "velocity[rad/s]": 6.5e-3, "torque[N.m]": 0.14}
    servo: {"bandwidth[Hz]": {value: 31.2, standard_error: 0.1}, "damping[1]": 0.72}
    terms:
      - term: footplate_inertia
        Ip[kg.m^2]: {value: 0.0042, standard_error: 0.00003}
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from ankle_interfaces.yaml_text import YamlError, parse_yaml, read_text
from ankle_physics.actuator import Servo
from ankle_physics.errors import ModelError
from ankle_physics.model import Model
from ankle_physics.term import Owner, Parameter

# Longer delays are a broken recording and no property of a rig (see the term `channel_skew`).
LONGEST_DELAY = 0.02  # s
TORQUE_DELAY = Parameter(
    "torque_delay",
    "s",
    -LONGEST_DELAY,
    LONGEST_DELAY,
    0.0,
    "up to a few sample blocks",
    description="It says how much later the torque is read than the position.",
)
VELOCITY_DELAY = Parameter(
    "velocity_delay",
    "s",
    -LONGEST_DELAY,
    LONGEST_DELAY,
    0.0,
    "up to a few sample blocks",
    description="It says how much later the velocity is read than the position.",
)
ZERO_POSITION = Parameter(
    "position",
    "rad",
    -3.2,
    3.2,
    0.0,
    "any mounting of the encoder",
    description="It is the position that the encoder shows at the zero of the joint.",
)
ZERO_TORQUE = Parameter(
    "torque",
    "N.m",
    -100.0,
    100.0,
    0.0,
    "offset of a bridge amplifier",
    description="It is the torque that the sensor shows without load.",
)
# Beyond these a channel is dead or connected to something else.
NOISE = (
    Parameter(
        "position",
        "rad",
        0.0,
        0.1,
        0.0,
        "0.1 rad is more than a perturbation",
        description="It is the standard deviation of the noise of the position.",
    ),
    Parameter(
        "velocity",
        "rad/s",
        0.0,
        10.0,
        0.0,
        "10 rad/s is more than a perturbation",
        description="It is the standard deviation of the noise of the velocity.",
    ),
    Parameter(
        "torque",
        "N.m",
        0.0,
        50.0,
        0.0,
        "50 N.m is more than a perturbation evokes",
        description="It is the standard deviation of the noise of the torque.",
    ),
)
BANDWIDTH = Parameter(
    "bandwidth",
    "Hz",
    1.0,
    500.0,
    30.0,
    "van 't Veld et al. 2018, II-B",
    description="It is the natural frequency of the servo's response to a command.",
)
DAMPING = Parameter(
    "damping",
    "1",
    0.1,
    5.0,
    0.7,
    "the usual choice",
    description="It is the damping ratio of the servo's response to a command.",
)
KNOWN_KEYS = frozenset(
    {"rig", "calibrated", "bag", "bag_sha256", "zero", "noise", "servo", "terms"}
) | {TORQUE_DELAY.key, VELOCITY_DELAY.key}
_SHA256 = re.compile(r"[0-9a-f]{64}")


class Measured(NamedTuple):
    """Holds a measured value.

    Attributes
    ----------
    value
        In the unit of its key.
    standard_error
        In the same unit; None where the value was stated and not measured.
    """

    value: float
    standard_error: float | None = None


NO_DELAY = Measured(0.0)


@dataclass(frozen=True)
class RigFile:
    """Describes a calibrated rig.

    Attributes
    ----------
    title
        Free text, ``laboratory 2, plate B``.
    calibrated
        When, with time zone.
    bag
        Name of the recording that it was found in.
    bag_sha256
        Fingerprint of that recording; empty where there is none.
    torque_delay
        How much later than the position the torque is read [s].
    velocity_delay
        How much later than the position the velocity is read [s].
    zero_position
        Reading of the encoder at the angle that counts as zero [rad].
    zero_torque
        Reading of the torque sensor without load [N.m].
    noise
        Standard deviation of each channel at rest, ``position[rad]``, ``velocity[rad/s]``,
        ``torque[N.m]``; a channel that was not recorded is missing.
    bandwidth
        Natural frequency of the position servo [Hz]; None where it is not known.
    damping
        Damping ratio of the servo [1]; None where it is not known.
    model
        The terms that belong to the rig, with standard errors.
    """

    title: str
    calibrated: datetime
    bag: str = ""
    bag_sha256: str = ""
    torque_delay: Measured = NO_DELAY
    velocity_delay: Measured = NO_DELAY
    zero_position: float = 0.0
    zero_torque: float = 0.0
    noise: Mapping[str, float] = field(default_factory=dict)
    bandwidth: Measured | None = None
    damping: Measured | None = None
    model: Model = field(default_factory=lambda: Model([]))

    def __post_init__(self) -> None:
        if self.calibrated.tzinfo is None:
            raise ModelError(f"rig: calibrated = {self.calibrated.isoformat()} has no time zone")
        for entry in self.model.entries:
            if entry.term.belongs_to is not Owner.RIG:
                raise ModelError(
                    f"rig: term '{entry.term.name}' belongs to the subject, not to the rig"
                )
            if entry.term.name == "channel_skew":
                raise ModelError(f"rig: write '{TORQUE_DELAY.key}' instead of term 'channel_skew'")
        if self.bag_sha256 and not _SHA256.fullmatch(self.bag_sha256):
            raise ModelError(f"rig: bag_sha256 = {self.bag_sha256} is no SHA-256 (64 hex digits)")

    @property
    def servo(self) -> Servo | None:
        """Return the position servo; None where it is not known."""
        if self.bandwidth is None:
            return None
        damping = self.damping.value if self.damping is not None else float(DAMPING.default)
        return Servo(self.bandwidth.value, damping)

    def age(self, now: datetime | None = None) -> float:
        """Return days since the calibration, at `now` (None: the present)."""
        return ((now or datetime.now(timezone.utc)) - self.calibrated).total_seconds() / 86400.0

    def twin(self, subject: Model) -> Model:
        """Return the model of rig and subject together, for simulation.

        Parameters
        ----------
        subject
            The joint; a term that the rig file states as well is taken from the rig file.

        Returns
        -------
        Model
            Both lists of terms; the delay of the torque as the term ``channel_skew``.
        """
        entries = list(self.model.entries)
        if self.torque_delay.value:
            entries += Model.of({"channel_skew": {"skew": self.torque_delay.value}}).entries
        names = {entry.term.name for entry in entries}
        entries += [entry for entry in subject.entries if entry.term.name not in names]
        return Model(entries, f"{subject.title} on {self.title}".strip())

    @classmethod
    def load(cls, path: str | Path) -> RigFile:
        """Read a rig file.

        Raises
        ------
        ModelError
            Not a rig file, unknown key or term, wrong unit, value out of range, a term that does
            not belong to a rig; names the file.
        OSError
            The file cannot be read.
        """
        try:
            return cls.from_text(read_text(path, "rig file"))
        except (ModelError, YamlError) as error:
            raise ModelError(f"{path}: {error}") from None

    @classmethod
    def from_text(cls, text: str) -> RigFile:
        """Read the text of a rig file.

        Raises
        ------
        ModelError
            As `load`, without the file's name.
        """
        try:
            content = parse_yaml(text)
        except YamlError as error:
            raise ModelError(str(error)) from None
        if not isinstance(content, dict) or "rig" not in content:
            raise ModelError("a rig file has 'rig: free text', 'calibrated: date' and 'terms'")
        unknown = sorted(str(key) for key in content if key not in KNOWN_KEYS)
        if unknown:
            raise ModelError(
                f"unknown key '{unknown[0]}' in a rig file; known: {', '.join(sorted(KNOWN_KEYS))}"
            )
        zero = _table(content, "zero", (ZERO_POSITION, ZERO_TORQUE))
        servo = _table(content, "servo", (BANDWIDTH, DAMPING))
        return cls(
            title=str(content["rig"]),
            calibrated=_date(content.get("calibrated")),
            bag=str(content.get("bag") or ""),
            bag_sha256=str(content.get("bag_sha256") or ""),
            torque_delay=_measured(content.get(TORQUE_DELAY.key, 0.0), TORQUE_DELAY),
            velocity_delay=_measured(content.get(VELOCITY_DELAY.key, 0.0), VELOCITY_DELAY),
            zero_position=zero.get(ZERO_POSITION.key, Measured(0.0)).value,
            zero_torque=zero.get(ZERO_TORQUE.key, Measured(0.0)).value,
            noise={key: found.value for key, found in _table(content, "noise", NOISE).items()},
            bandwidth=servo.get(BANDWIDTH.key),
            damping=servo.get(DAMPING.key),
            model=Model.from_content({"terms": content.get("terms") or []}),
        )

    def text(self) -> str:
        """Return the file's text, which `from_text` reads back to the same values."""
        content: dict[str, Any] = {
            "rig": self.title,
            "calibrated": self.calibrated.astimezone(timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ"),
        }
        if self.bag:
            content["bag"] = self.bag
        if self.bag_sha256:
            content["bag_sha256"] = self.bag_sha256
        content[TORQUE_DELAY.key] = _written(self.torque_delay)
        content[VELOCITY_DELAY.key] = _written(self.velocity_delay)
        content["zero"] = {
            ZERO_POSITION.key: float(self.zero_position),
            ZERO_TORQUE.key: float(self.zero_torque),
        }
        content["noise"] = {key: float(value) for key, value in self.noise.items()}
        servo = {BANDWIDTH.key: self.bandwidth, DAMPING.key: self.damping}
        if self.bandwidth is not None:
            content["servo"] = {k: _written(m) for k, m in servo.items() if m is not None}
        content["terms"] = self.model.content()
        return yaml.safe_dump(content, sort_keys=False)

    def save(self, path: str | Path) -> None:
        """Write the file.

        Raises
        ------
        OSError
            The file cannot be written.
        """
        Path(path).write_text(self.text())


def _measured(given: Any, parameter: Parameter) -> Measured:
    error = None
    if isinstance(given, dict):
        stated = given.get("standard_error")
        if stated is not None:
            error = _positive(stated, parameter)
        given = given.get("value")
    return Measured(parameter.value(given, "rig"), error)


def _positive(stated: Any, parameter: Parameter) -> float:
    try:
        error = float(stated)
    except (TypeError, ValueError):
        error = -1.0
    if not 0.0 <= error < float("inf"):
        raise ModelError(
            f"rig: standard error of {parameter.symbol} = {stated} {parameter.unit} is not a "
            "number of 0 or more"
        )
    return error


def _table(
    content: Mapping[str, Any], key: str, parameters: tuple[Parameter, ...]
) -> dict[str, Measured]:
    given = content.get(key) or {}
    if not isinstance(given, dict):
        raise ModelError(f"rig: '{key}' is a table such as {{{parameters[0].key}: 0.0}}")
    known = {parameter.key: parameter for parameter in parameters}
    for name in given:
        if name not in known:
            raise ModelError(f"rig: '{key}' has no '{name}'; it has {', '.join(known)}")
    return {name: _measured(value, known[name]) for name, value in given.items()}


def _date(given: Any) -> datetime:
    if isinstance(given, str):
        with contextlib.suppress(ValueError):
            given = datetime.fromisoformat(given.replace("Z", "+00:00"))
    if not isinstance(given, datetime):
        raise ModelError(f"rig: calibrated = {given!r} is no date such as 2026-11-20T14:02:11Z")
    # YAML reads a date with Z as UTC and drops the zone in older versions.
    return given if given.tzinfo is not None else given.replace(tzinfo=timezone.utc)


def _written(found: Measured) -> Any:
    if found.standard_error is None:
        return float(found.value)
    return {"value": float(found.value), "standard_error": float(found.standard_error)}
