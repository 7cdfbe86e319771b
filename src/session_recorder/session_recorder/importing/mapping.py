"""What the columns of an unknown file are likely to be: names and units first, then what an ankle
allows.
"""

from __future__ import annotations

import re
from itertools import permutations, product

import numpy as np

from session_recorder.errors import ImportRefused
from session_recorder.importing.column_names import (
    MUSCLES,
    has_unit_of,
    is_commanded,
    likeliest,
    quantity_of,
    side_of,
)
from session_recorder.importing.laboratory_units import to_si, unknown_unit
from session_recorder.importing.plausibility import (
    LARGEST_EMG,
    LARGEST_TORQUE,
    VELOCITY_GAIN_RANGE,
    Intrinsic,
    velocity_gain,
)
from session_recorder.importing.possible_units import (
    TORQUE_UNITS,
    largest,
    possible_angle,
    readings,
    same_quantity,
)
from session_recorder.importing.proposal import Proposal
from session_recorder.importing.sampling import Sampling
from session_recorder.importing.table import Table
from session_recorder.importing.time_column import comparable, even_columns, find_time

_TYPICAL_INERTIA = 0.013
"""[kg.m^2] The paper's ankle; of two readings that are possible the nearer one is likelier."""
_EMG_RMS = (1e-7, 2e-3)
"""[V] Rms of surface EMG, from a relaxed to a maximally contracted muscle."""
_RIGHT_ANGLE = 90.0
"""[deg] Of the neutral ankle in files that count the angle between shank and foot."""
_NEAR_RIGHT_ANGLE = 1.0 / 3.0
"""Part of a right angle by which the middle of such a recording may differ from it."""
_PLANTARFLEXION = re.compile(r"plantar|(?<![a-z])pf(?![a-z])", re.IGNORECASE)
_DORSIFLEXION = re.compile(r"dorsi|(?<![a-z])df(?![a-z])", re.IGNORECASE)
_MAX_TRIED_COLUMNS = 6
"""Columns that are tried as position and torque, each with each."""
_PER_MASS = re.compile(r"/\s*kg|kg\s*(\^|\*\*)?\s*-1|bw|body", re.IGNORECASE)
"""Units of a torque that is divided by the subject's mass."""
_LIKE_A_UNIT = re.compile(r"[/·*^%]|\w\.\w|kg|lb|oz")
"""What stands in the brackets behind a name and is a unit, not a remark."""
_SHOWN_OTHERS = 4


def propose(table: Table) -> Proposal:
    """Propose what the columns of a table are.

    Parameters
    ----------
    table
        Values of the file by column.

    Raises
    ------
    ImportRefused
        Nothing looks like a position, a torque or EMG, or nothing gives the time; the message says
        what to state.
    """
    proposal = Proposal(sections=table.sections)
    candidates = _by_name(table, proposal)
    found = {quantity: names[0] for quantity, names in candidates.items()}
    sampling = find_time(table, found, proposal)
    whole = table
    table, sampling = comparable(table, candidates, found, sampling, proposal)
    if "torque" not in found and "position" not in found:
        _by_data(table, found, sampling, proposal)
    else:
        _by_movement(table, candidates, found, sampling, proposal)
    _mechanics(table, found, sampling, proposal)
    _emg(whole, found, proposal)
    missing = [quantity for quantity in ("position", "torque") if quantity not in found]
    if len(missing) == 1:
        proposal.doubts.append(
            f"no column looks like a {missing[0]}: 'ankle estimate' needs angle and torque, and a "
            "force has to be multiplied by its lever arm first"
        )
    if not any(not name.startswith("t[") for name in proposal.columns):
        raise ImportRefused(
            f"{table.source}: no column looks like a position, a torque or EMG; it holds "
            f"{', '.join(table.names)}. State them, as in --column 'position[deg]=NAME' --column "
            "'torque[N.m]=NAME', or --column 'SOL[mV]=NAME' for EMG"
        )
    return proposal


def _by_name(table: Table, proposal: Proposal) -> dict[str, list[str]]:
    """Return columns whose name says what they are, by quantity, the likeliest first."""
    candidates: dict[str, list[str]] = {}
    unusable: dict[str, str] = {}
    for name in table.columns:
        unit = table.units.get(name)
        quantity = quantity_of(name, unit)
        if quantity is None:
            continue
        if not has_unit_of(quantity, unit):
            unusable[name] = f"'{name}' is in {unit}: multiply it by the factor of its sensor"
        elif (own := unknown_unit(name)) and _PER_MASS.search(own):
            unusable[name] = f"'{name}' is in {own}: multiply it by the subject's body mass [kg]"
        elif own and quantity in ("position", "torque") and _LIKE_A_UNIT.search(own):
            unusable[name] = f"'{name}' is in {own}, which is no unit that is known: convert it"
        else:
            candidates.setdefault(quantity, []).append(name)
    for name, reason in {**table.refused, **unusable}.items():
        quantity = quantity_of(name, table.units.get(name))
        if quantity in candidates or quantity is None or f"{name}:1" in table.columns:
            continue
        if quantity in ("t", "position", "torque"):
            raise ImportRefused(
                f"{reason}. Mend the file, or state the columns to take without it, as in --column "
                "'position[deg]=NAME'"
            )
        proposal.doubts.append(f"'{name}' is left out: {reason}")
    return {quantity: _different(table, likeliest(names)) for quantity, names in candidates.items()}


def _different(table: Table, names: list[str]) -> list[str]:
    """Return the first column and those that hold other numbers."""
    first = table.columns[names[0]]
    others = [name for name in names[1:] if not np.array_equal(table.columns[name], first)]
    return [names[0], *others]


def _by_movement(
    table: Table,
    candidates: dict[str, list[str]],
    found: dict[str, str],
    sampling: Sampling,
    proposal: Proposal,
) -> None:
    """Choose among several columns of a quantity: of angles and torques those that move and answer
    as an ankle's do; of other quantities those of the same side of the body.
    """
    angles, torques = candidates.get("position", []), candidates.get("torque", [])
    if len(angles) * len(torques) > 1:
        even = even_columns(table, [*angles, *torques], sampling, proposal)
        best = 0.0
        for angle, torque in product(angles[:_MAX_TRIED_COLUMNS], torques[:_MAX_TRIED_COLUMNS]):
            if len(even[angle]) != len(even[torque]):
                continue
            around = even[angle] - np.nanmedian(even[angle])
            units = table.units.get(angle), table.units.get(torque)
            for fit, _, _ in readings(around, even[torque], *units, sampling.rate):
                if fit.explained > best:
                    best, found["position"], found["torque"] = fit.explained, angle, torque
        if best:
            proposal.reasons.append(
                f"of {len(angles)} angles and {len(torques)} torques '{found['position']}' moves "
                f"and '{found['torque']}' answers as an ankle's do ({100 * best:.0f} % explained)"
            )
    side = side_of(found.get("torque", "")) or side_of(found.get("position", ""))
    for quantity in found:
        same = [name for name in candidates.get(quantity, []) if side_of(name) == side]
        if side and same and side_of(found[quantity]) != side:
            found[quantity] = same[0]
        others = [name for name in candidates.get(quantity, []) if name != found[quantity]]
        if others:
            proposal.doubts.append(
                f"{quantity} is taken from '{found[quantity]}', not from "
                + ", ".join(f"'{name}'" for name in others[:_SHOWN_OTHERS])
            )


def _by_data(table: Table, found: dict[str, str], sampling: Sampling, proposal: Proposal) -> None:
    """Find position and torque among columns whose names say nothing.

    They are the pair that an ankle explains best.
    """
    used = {*found.values(), *proposal.columns.values()}
    free = [name for name in table.columns if name not in used][:_MAX_TRIED_COLUMNS]
    even = even_columns(table, free, sampling, proposal)
    best: tuple[float, str, str] | None = None
    for position, torque in permutations(free, 2):
        if len(even[position]) != len(even[torque]):
            continue
        if same_quantity(even[position], even[torque]):
            continue
        for fit, _, _ in readings(even[position], even[torque], None, None, sampling.rate):
            if best is None or fit.explained > best[0]:
                best = (fit.explained, position, torque)
    if best is not None:
        found["position"], found["torque"] = best[1], best[2]
        proposal.doubts.append(
            f"names do not tell: '{best[1]}' moves and '{best[2]}' answers as an ankle's angle and "
            f"torque do ({100 * best[0]:.0f} % explained)"
        )


def _mechanics(table: Table, found: dict[str, str], sampling: Sampling, proposal: Proposal) -> None:
    mechanical = {
        quantity: name
        for quantity, name in found.items()
        if quantity in ("position", "velocity", "torque") or quantity.startswith("reference_")
    }
    even = even_columns(table, mechanical.values(), sampling, proposal)
    position, torque = mechanical.get("position"), mechanical.get("torque")
    angle_unit = table.units.get(position or "")
    if position:
        angle_unit = _conventions(even, position, angle_unit, proposal)
    torque_unit = table.units.get(torque or "")
    fit = None
    if position and torque and len(even[position]) == len(even[torque]):
        possible = sorted(
            readings(even[position], even[torque], angle_unit, torque_unit, sampling.rate),
            key=lambda r: abs(
                np.log(abs(r[0].inertia) * to_si(r[2])[1] / to_si(r[1])[1] / _TYPICAL_INERTIA)
            ),
        )
        if possible:
            fit, angle, force = possible[0]
            inertia = abs(fit.inertia) * to_si(force)[1] / to_si(angle)[1]
            if angle_unit is None or torque_unit is None:
                proposal.reasons.append(
                    f"position in {angle} and torque in {force} give an inertia of {inertia:.3g} "
                    "kg.m^2, as an ankle has"
                )
                if len(possible) > 1:
                    proposal.doubts.append(
                        f"position in {possible[1][1]} and torque in {possible[1][2]} would be "
                        "possible as well"
                    )
            angle_unit, torque_unit = angle, force
    if position:
        unit = angle_unit or _guess_angle(even[position], position, proposal)
        _state(proposal, "position", unit, position, table)
        angle_unit = unit
        _commanded_angle(table, mechanical, position, angle_unit, proposal)
    if velocity := mechanical.get("velocity"):
        _velocity(table, velocity, even, position, angle_unit, sampling, proposal)
    for quantity in ("reference_position", "reference_velocity", "reference_acceleration"):
        if (name := mechanical.get(quantity)) is not None:
            power = {"position": "", "velocity": "/s", "acceleration": "/s^2"}[quantity[10:]]
            unit = table.units.get(name) or f"{(angle_unit or 'rad').replace('mrad', 'rad')}{power}"
            _state(proposal, quantity, unit, name, table)
    if torque:
        _torque(table, torque, torque_unit, fit, proposal)


def _conventions(
    even: dict[str, np.ndarray], name: str, unit: str | None, proposal: Proposal
) -> str | None:
    """State where the file's angle has its zero and in which direction it rises; return its unit,
    which a right angle tells as well.
    """
    middle = float(np.median(values)) if len(values := even[name][np.isfinite(even[name])]) else 0.0
    likely_unit = unit or "deg"
    right = _RIGHT_ANGLE * to_si("deg")[1] / to_si(likely_unit)[1]
    if abs(abs(middle) - right) < _NEAR_RIGHT_ANGLE * right:
        unit = likely_unit
        proposal.neutral = float(np.copysign(round(right, 4), middle))
        even[name] = even[name] - proposal.neutral
        proposal.doubts.append(
            f"'{name}' is about {middle:.3g} {unit}, as where {proposal.neutral:g} is the neutral "
            "ankle: this is taken off"
        )
    if _PLANTARFLEXION.search(name) and not _DORSIFLEXION.search(name):
        proposal.positive = "plantarflexion"
        proposal.reasons.append(f"'{name}' rises in plantarflexion by its name")
    elif not _DORSIFLEXION.search(name):
        proposal.doubts.append(
            f"numbers do not tell in which direction '{name}' rises: dorsiflexion is assumed; if "
            "it is plantarflexion, add --positive plantarflexion"
        )
    return unit


def _state(proposal: Proposal, quantity: str, unit: str, name: str, table: Table) -> None:
    proposal.columns[f"{quantity}[{unit}]"] = name
    if name not in table.units and (text := unknown_unit(name)):
        proposal.doubts.append(f"'{text}' of '{name}' is no unit that is known: is it in {unit}?")
    if name in table.units:
        proposal.reasons.append(f"'{name}' is {quantity}: its name or the file says so, in {unit}")


def _commanded_angle(
    table: Table, mechanical: dict[str, str], position: str, unit: str, proposal: Proposal
) -> None:
    """Find a commanded angle whose name says only that it is a command: it moves as the angle."""
    if "reference_position" in mechanical:
        return
    measured = table.columns[position]
    for name, values in table.columns.items():
        if name == position or name in table.units or not is_commanded(name):
            continue
        if len(values) == len(measured) and same_quantity(measured, values):
            _state(proposal, "reference_position", unit, name, table)
            proposal.reasons.append(f"'{name}' is a command and moves as '{position}'")
            return


def _guess_angle(values: np.ndarray, name: str, proposal: Proposal) -> str:
    unit = next((unit for unit in ("rad", "deg", "mrad") if possible_angle(values, unit)), "rad")
    proposal.doubts.append(
        f"'{name}' states no unit; {unit} is possible by its size ({largest(values):.3g})"
    )
    return unit


def _velocity(
    table: Table,
    name: str,
    even: dict[str, np.ndarray],
    position: str | None,
    angle_unit: str | None,
    sampling: Sampling,
    proposal: Proposal,
) -> None:
    unit = table.units.get(name)
    if unit is None and position is not None and angle_unit is not None:
        found = velocity_gain(sampling.rate, even[position] * to_si(angle_unit)[1], even[name])
        for candidate in ("rad/s", "deg/s", "mrad/s"):
            low, high = VELOCITY_GAIN_RANGE
            if found is not None and low <= found[0] * to_si(candidate)[1] <= high:
                unit = candidate
                proposal.reasons.append(
                    f"'{name}' in {candidate} is the derivative of '{position}'"
                )
                break
    if unit is None:
        proposal.doubts.append(f"'{name}' is left out: its unit is not known")
        return
    _state(proposal, "velocity", unit, name, table)


def _torque(
    table: Table, name: str, unit: str | None, fit: Intrinsic | None, proposal: Proposal
) -> None:
    if unit is None:
        unit = next(
            (
                u
                for u in TORQUE_UNITS
                if largest(table.columns[name]) * to_si(u)[1] <= LARGEST_TORQUE
            ),
            "N.m",
        )
        proposal.doubts.append(f"'{name}' states no unit; {unit} is a guess")
    _state(proposal, "torque", unit, name, table)
    if fit is None:
        proposal.torque_sign = "rig"
        proposal.doubts.append(
            "the torque's sign is a guess, because the data show too little fast movement: 'rig' "
            "is the torque that moves the ankle, 'subject' the opposite"
        )
        return
    proposal.torque_sign = "subject" if fit.sign < 0 else "rig"
    why = "a passive joint explains more" if fit.contradicts_itself else "the inertia is positive"
    proposal.reasons.append(f"the torque has the {proposal.torque_sign}'s sign: with it {why}")


def _emg(table: Table, found: dict[str, str], proposal: Proposal) -> None:
    for muscle in MUSCLES:
        name = found.get(muscle)
        if name is None:
            continue
        unit = table.units.get(name)
        if unit is None:
            values = table.columns[name][np.isfinite(table.columns[name])]
            rms = float(np.std(values)) if len(values) else 0.0
            unit = next(
                (
                    u
                    for u in ("V", "mV", "uV")
                    if _EMG_RMS[0] <= rms * to_si(u)[1] <= _EMG_RMS[1]
                    and largest(values) * to_si(u)[1] <= LARGEST_EMG
                ),
                None,
            )
            if unit is None:
                proposal.doubts.append(f"'{name}' is left out: {rms:.3g} rms is no EMG in V to uV")
                continue
            proposal.doubts.append(f"'{name}' states no unit; {rms:.3g} rms is EMG in {unit}")
        _state(proposal, muscle, unit, name, table)
