"""The file ``rig.yaml`` is made from a bag of the signal ``rig_calibration``."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path

import numpy as np

from ankle_interfaces.block import Block
from ankle_interfaces.continuity import sampling_rate
from ankle_interfaces.topics import ANKLE_SAMPLES, PERTURBATION_REFERENCE
from ankle_physics.model import Model
from ankle_physics.rig_agreement import rig_warnings
from ankle_physics.rig_file import Measured, RigFile
from ankle_physics.term import term_library
from ankle_physics.terms.footplate_friction import FootplateFriction
from calibration.errors import CalibrationError
from calibration.fitted_value import Found
from calibration.known_load import KnownLoad, require_load
from calibration.rig_identification import IdentifiedRig, identify_rig
from calibration.rig_spectra import Signals
from session_recorder.bag_reader import BagReader

SAMPLES, REFERENCE = ANKLE_SAMPLES.absolute, PERTURBATION_REFERENCE.absolute
POSITION, VELOCITY, TORQUE = "position[rad]", "velocity[rad/s]", "torque[N.m]"
# A parameter counts as found where it is this many standard errors away from nothing.
MIN_SIGNIFICANCE = 3.0
# A calibration shorter than this has too few edges for the accuracies that are stated.
MIN_DURATION = 20.0  # s
# Moves a servo of a few thousand N.m/rad by some per cent of the movement, within the torque of a
# rig.
USUAL_SPRINGS = "a spring of 50 to 200 N.m/rad"


@dataclass(frozen=True)
class Calibrated:
    """Holds a calibrated rig.

    Attributes
    ----------
    rig
        What is written to ``rig.yaml``.
    identified
        Every number that was found.
    remarks
        Sentences: what was not found, and what would show it.
    beside
        The file of the same rig that was completed; None: all was found in this recording.
    """

    rig: RigFile
    identified: IdentifiedRig
    remarks: tuple[str, ...]
    beside: RigFile | None = None


def calibrate_rig(
    bag: Path | str,
    title: str = "",
    load: KnownLoad | None = None,
    progress: Callable[[str], None] = lambda _: None,
    beside: RigFile | None = None,
) -> Calibrated:
    """Calibrate a rig from a bag.

    Parameters
    ----------
    bag
        Holds ``/ankle/samples`` and ``/perturbation/reference`` of the signal
        ``rig_calibration``; the plate empty or with a known load.
    title
        Name of the rig, free text; empty takes the bag's.
    load
        What is mounted on the plate; None: nothing.
    progress
        Called with the present step.
    beside
        The file of the same rig, calibrated with its plate empty. Everything in it is kept, and the
        compliance of the servo, which a spring shows, is added. None: everything is found in this
        recording.

    Raises
    ------
    CalibrationError
        The recording is too short, lacks the reference, its torque does not follow the plate, the
        load is not the known one, or the recording contradicts `beside`.
    session_recorder.errors.BagError
        No such bag or topic.
    """
    load = load or KnownLoad()
    if beside is not None and load.spring == 0.0:
        raise CalibrationError(
            "a spring on the plate shows how far the servo gives way, which is added to the rig "
            "file: name its stiffness (--spring)"
        )
    path = Path(bag)
    progress("reading")
    signals = read_signals(path)
    progress("identifying the rig")
    identified = identify_rig(signals)
    if beside is not None:
        completed = with_compliance(beside, identified, load, signals)
        return Calibrated(replace(completed, title=title or beside.title), identified, (), beside)
    rig, remarks = rig_file(
        identified,
        title or path.name,
        load,
        bag=path.resolve().name,
        bag_sha256=fingerprint(path),
        angle=float(np.mean(signals.position)),
    )
    return Calibrated(rig, identified, remarks)


def with_compliance(
    beside: RigFile, found: IdentifiedRig, load: KnownLoad, signals: Signals
) -> RigFile:
    """Return a rig file with the compliance of the servo that a spring on the plate shows.

    All else stays as the file states it: it was calibrated once, and may be in use.

    Parameters
    ----------
    beside
        The file of the rig with its plate empty.
    found
        What the recording with the spring shows.
    load
        The spring.
    signals
        The recording with the spring.

    Raises
    ------
    CalibrationError
        The spring is not seen or is too soft, or the recording is one of another rig.
    """
    require_load(found, load)
    contradictions = rig_warnings(
        beside,
        signals.rate,
        signals.position,
        signals.velocity,
        signals.torque,
        now=beside.calibrated,
    )
    if contradictions:
        raise CalibrationError(
            f"the recording contradicts the file of the rig '{beside.title}': "
            f"{'; '.join(contradictions)}. Calibrate that rig with its plate empty first"
        )
    if found.servo_stiffness is None:
        raise CalibrationError(
            f"a spring of {load.spring:g} N.m/rad does not show how far the servo gives way; mount "
            f"{USUAL_SPRINGS}"
        )
    values = {"servo_compliance": {"k_a": found.servo_stiffness}}
    if remarks := _without_implausible(values):
        raise CalibrationError("; ".join(remarks))
    kept = [entry for entry in beside.model.entries if entry.term.name not in values]
    return replace(beside, model=Model([*kept, *_model(values).entries], beside.model.title))


def read_signals(bag: Path) -> Signals:
    """Return the channels of a bag and its reference at the samples' times.

    Raises
    ------
    CalibrationError
        Too short, or the reference does not cover the samples.
    session_recorder.errors.BagError
        No such bag or topic.
    """
    reader = BagReader(bag)
    samples = _in_si(*reader.signal(SAMPLES))
    command = _in_si(*reader.signal(REFERENCE))
    time, commanded = samples.column("t[s]"), command.column("t[s]")
    inside = (time >= commanded[0]) & (time <= commanded[-1])
    if np.ptp(time[inside]) < MIN_DURATION if inside.any() else True:
        raise CalibrationError(
            f"{bag}: reference and samples overlap for less than {MIN_DURATION:g} s; record the "
            "whole signal 'rig_calibration'"
        )
    velocity = samples.column(VELOCITY)[inside] if samples.has(VELOCITY) else None
    return Signals(
        sampling_rate(time[inside]),
        samples.column(POSITION)[inside],
        velocity,
        samples.column(TORQUE)[inside],
        np.interp(time[inside], commanded, command.column(POSITION)),
    )


def _in_si(columns: tuple[str, ...], data: np.ndarray) -> Block:
    converted, _ = Block(columns, data).in_si()
    return converted


def rig_file(
    found: IdentifiedRig,
    title: str,
    load: KnownLoad,
    bag: str = "",
    bag_sha256: str = "",
    angle: float = 0.0,
    now: datetime | None = None,
) -> tuple[RigFile, tuple[str, ...]]:
    """Return the rig file of an identified rig, and what could not be found.

    Parameters
    ----------
    found
        The numbers that the calibration found.
    title
        Name of the rig.
    load
        What was mounted; it is taken off.
    bag, bag_sha256
        Where the numbers come from.
    angle
        Mean angle of the plate [rad]: its weight is written about it, as a torque of zero there.
    now
        Date of the calibration; None: the present.

    Returns
    -------
    tuple[RigFile, tuple[str, ...]]
        The file, and remarks.

    Raises
    ------
    CalibrationError
        A known load larger than what was found, a load that is not known, or an inertia that no
        plate has.
    """
    require_load(found, load)
    values, remarks = _terms(found, load, angle)
    if found.noise[1] is None:
        remarks.append("no velocity was recorded, so its delay and noise are not known")
    noise = {POSITION: found.noise[0], TORQUE: found.noise[2]}
    if found.noise[1] is not None:
        noise[VELOCITY] = found.noise[1]
    velocity_delay = found.velocity_delay or Found(0.0, 0.0)
    rig = RigFile(
        title=title,
        calibrated=now or datetime.now(timezone.utc),
        bag=bag,
        bag_sha256=bag_sha256,
        torque_delay=_measured(found.torque_delay),
        velocity_delay=_measured(velocity_delay),
        zero_position=found.zero_position,
        zero_torque=found.zero_torque,
        noise=noise,
        bandwidth=_measured(found.bandwidth),
        damping=_measured(found.damping),
        model=_model(values),
    )
    return rig, tuple(remarks)


def _terms(
    found: IdentifiedRig, load: KnownLoad, angle: float
) -> tuple[dict[str, dict[str, Found]], list[str]]:
    """Return the rig's terms with the values that were found, and what could not be found."""
    values: dict[str, dict[str, Found]] = {}
    remarks = []
    inertia = Found(found.inertia.value - load.inertia, found.inertia.error)
    if inertia.value <= 0.0:
        raise CalibrationError(
            f"the inertia found, {found.inertia.value:.5f} kg.m^2, is less than the known load of "
            f"{load.inertia:g} kg.m^2: check the mounting and the sign of the torque"
        )
    values["footplate_inertia"] = {"Ip": inertia}
    if found.friction.value > MIN_SIGNIFICANCE * found.friction.error:
        v0 = found.friction_velocity
        # Below its range, noise of the velocity rounds the jump, and nobody can tell.
        least = FootplateFriction.parameter("v0").lower
        rounding = Found(max(v0.value, least), v0.error)
        values["footplate_friction"] = {"F": found.friction, "v0": rounding}
    slope = Found(found.slope.value - load.spring, found.slope.error)
    if abs(slope.value) > MIN_SIGNIFICANCE * slope.error:
        # A centre of mass above the axis pulls the plate away: the same weight, half a turn on.
        level = angle if slope.value > 0.0 else angle - math.copysign(math.pi, angle)
        values["footplate_gravity"] = {
            "m": Found(abs(slope.value), slope.error),
            "level": Found(level, 0.0),
        }
    if found.lag is not None:
        values["torque_sensor_lag"] = {"T": found.lag}
    if found.mode is not None:
        values["torque_sensor_mode"] = {"frequency": found.mode[0], "damping": found.mode[1]}
    if found.servo_stiffness is not None:
        values["servo_compliance"] = {"k_a": found.servo_stiffness}
    else:
        remarks.append(
            "how far the servo gives way was not found: the load was too small. Mount "
            f"{USUAL_SPRINGS} and calibrate with it (--spring)"
        )
    remarks += _without_implausible(values)
    return values, remarks


def _without_implausible(values: dict[str, dict[str, Found]]) -> list[str]:
    """Take out terms with a value outside the library's range; return a sentence for each.

    A rig without such a term is calibrated less; one with a value that nobody can use is not
    calibrated at all. No rig is without inertia.

    Raises
    ------
    CalibrationError
        An inertia that no plate has.
    """
    remarks = []
    for name, own in list(values.items()):
        for symbol, found in own.items():
            allowed = term_library()[name].parameter(symbol)
            if allowed.lower <= found.value <= allowed.upper:
                continue
            outside = (
                f"{name}.{allowed.key} was found as {found.value:.4g} ± {found.error:.2g}, "
                f"outside {allowed.lower:g} to {allowed.upper:g}"
            )
            if name == "footplate_inertia":
                raise CalibrationError(f"{outside}: check unit and sign of the torque")
            del values[name]
            remarks.append(f"{outside}: it is left out. Check the mounting, and calibrate again")
            break
    return remarks


def _measured(found: Found) -> Measured:
    return Measured(found.value, found.error)


def _model(values: dict[str, dict[str, Found]]) -> Model:
    model = Model.of(
        {name: {symbol: f.value for symbol, f in own.items()} for name, own in values.items()}
    )
    for name, own in values.items():
        model.entry(name).standard_errors = {symbol: f.error for symbol, f in own.items()}
    return model


def fingerprint(bag: Path) -> str:
    """Return the SHA-256 over the files of a bag, by name."""
    digest = hashlib.sha256()
    for file in sorted(p for p in bag.rglob("*") if p.is_file()):
        digest.update(file.relative_to(bag).as_posix().encode() + b"\0")
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()
