"""What a user states about a recording: each column's quantity and unit, rate, sign of torque."""

from __future__ import annotations

from collections.abc import Mapping

from ankle_interfaces.block import TIME_COLUMN
from ankle_interfaces.errors import UnitError
from ankle_interfaces.topics import ANKLE_SAMPLES, EMG_SAMPLES, PERTURBATION_REFERENCE
from ankle_interfaces.units import split_column
from session_recorder.errors import ImportRefused
from session_recorder.importing.laboratory_units import known_unit, to_si

# Torque positive in dorsiflexion: what the rig needs to move the ankle (this project), or what the
# subject exerts.
TORQUE_SIGNS = {"rig": 1.0, "subject": -1.0}
# The direction in which the angle of a file rises, as a factor to this project's.
PROJECT_DIRECTION = "dorsiflexion"
DIRECTIONS = {PROJECT_DIRECTION: 1.0, "plantarflexion": -1.0}
MISSING_POLICIES = ("nan", "gap")
# Quantity -> topic and column there. EMG columns have the muscle's name and a unit of voltage.
QUANTITIES = {
    "position": (ANKLE_SAMPLES.absolute, "position[rad]"),
    "velocity": (ANKLE_SAMPLES.absolute, "velocity[rad/s]"),
    "torque": (ANKLE_SAMPLES.absolute, "torque[N.m]"),
    "reference_position": (PERTURBATION_REFERENCE.absolute, "position[rad]"),
    "reference_velocity": (PERTURBATION_REFERENCE.absolute, "velocity[rad/s]"),
    "reference_acceleration": (PERTURBATION_REFERENCE.absolute, "acceleration[rad/s^2]"),
}
EMG_TOPIC = EMG_SAMPLES.absolute
# Slower does not show an ankle's mechanics, faster is no rig: such a rate is a time column in
# another unit.
RATE_RANGE = (50.0, 100_000.0)  # Hz


def spelled(name: str) -> str:
    """Return a stated name with its unit in the project's spelling: ``torque[Nm]`` as
    ``torque[N.m]``.
    """
    quantity, bracket, unit = name.strip().rstrip("]").partition("[")
    return f"{quantity.strip()}[{known_unit(unit) or unit}]" if bracket else name


def meaning(name: str) -> tuple[str, str, float]:
    """Return topic (empty for time), SI column and factor of a stated name."""
    try:
        quantity, unit = split_column(name)
        si, factor = to_si(unit)
    except UnitError as error:
        raise ImportRefused(str(error)) from None
    if quantity == "t":
        topic, column = "", TIME_COLUMN
    elif quantity in QUANTITIES:
        topic, column = QUANTITIES[quantity]
    elif si == "V":
        return EMG_TOPIC, f"{quantity}[V]", factor
    else:
        raise ImportRefused(
            f"'{name}': unknown quantity; known: t, {', '.join(QUANTITIES)}, and muscles in V, mV "
            "or uV"
        )
    expected = split_column(column)[1]
    if si != expected:
        raise ImportRefused(
            f"'{name}': {quantity} is given in '{unit}', expected {expected} or a multiple of it"
        )
    return topic, column, factor


def check_statement(
    stated: Mapping[str, tuple[str, str, float]],
    torque_sign: str | None,
    rate: float | None,
    missing: str,
    positive: str | None,
) -> None:
    """Check that a statement is complete and does not contradict itself.

    Parameters
    ----------
    stated
        What `meaning` says of each stated name.
    torque_sign, rate, missing, positive
        See `import_recording`.

    Raises
    ------
    ImportRefused
        It is not complete, or a part is not known; the message says what to state.
    """
    held = [(topic, column) for topic, column, _ in stated.values()]
    if len(set(held)) < len(held):
        raise ImportRefused(f"a quantity is stated twice: {', '.join(stated)}")
    if all(not topic for topic, _ in held):
        raise ImportRefused(
            "no signal is stated; expected for example 'position[rad]' and 'torque[N.m]'"
        )
    if (ANKLE_SAMPLES.absolute, "torque[N.m]") in held and torque_sign is None:
        raise ImportRefused(
            "the sign of torque is not stated: 'rig' (torque that moves the ankle) or 'subject' "
            "(the opposite)"
        )
    if torque_sign is not None and torque_sign not in TORQUE_SIGNS:
        raise ImportRefused(
            f"torque sign '{torque_sign}' is not known; expected {' or '.join(TORQUE_SIGNS)}"
        )
    if positive is not None and positive not in DIRECTIONS:
        raise ImportRefused(
            f"positive direction '{positive}' is not known; expected {' or '.join(DIRECTIONS)}"
        )
    if missing not in MISSING_POLICIES:
        raise ImportRefused(
            f"policy '{missing}' for missing samples is not known; expected "
            f"{' or '.join(MISSING_POLICIES)}"
        )
    if rate is None and ("", TIME_COLUMN) not in held:
        raise ImportRefused("neither a sampling rate nor a time column is stated")
    if rate is not None and not RATE_RANGE[0] <= rate <= RATE_RANGE[1]:
        raise ImportRefused(
            f"sampling rate {rate:g} Hz is refused; allowed: {RATE_RANGE[0]:g} to "
            f"{RATE_RANGE[1]:g} Hz"
        )


def check_grid(resample: float | None) -> None:
    """Refuse a rate [Hz] to resample to that is out of range; 0 is the samples' mean rate."""
    if resample is not None and resample != 0 and not RATE_RANGE[0] <= resample <= RATE_RANGE[1]:
        raise ImportRefused(
            f"resampling to {resample:g} Hz is refused; allowed: {RATE_RANGE[0]:g} to "
            f"{RATE_RANGE[1]:g} Hz, or 0 for the mean rate of the samples"
        )


def check_units(columns: Mapping[str, str], declared: Mapping[str, str]) -> list[str]:
    """Return where a stated unit is another than the file declares; both are compared in SI, and
    what is no unit to us is not judged.
    """
    found = []
    for name, column in columns.items():
        stated = split_column(name)[1]
        try:
            own = to_si(declared.get(column, ""))
        except UnitError:
            continue
        if own != to_si(stated):
            found.append(
                f"'{name}' is stated in {stated}, the file declares '{column}' in "
                f"{declared[column]}"
            )
    return found
