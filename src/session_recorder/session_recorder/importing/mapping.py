"""What the columns of an unknown file are likely to be: names and units first, then what an ankle
allows.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import permutations
from pathlib import Path

import numpy as np

from ankle_interfaces.units import to_si
from session_recorder.errors import ImportRefused
from session_recorder.importing.laboratory_units import split_header
from session_recorder.importing.plausibility import (
    CERTAIN,
    INERTIA_RANGE,
    LARGEST_EMG,
    LARGEST_POSITION,
    LARGEST_SPREAD,
    LARGEST_TORQUE,
    VELOCITY_GAIN_RANGE,
    Intrinsic,
    intrinsic,
    velocity_gain,
)
from session_recorder.importing.sampling import MAX_GRID, Sampling, judge_times
from session_recorder.importing.tables import TIME, Table

# Words for each quantity, in the languages that laboratories' files speak. The first that fits
# decides; torque stands before angle, because "ankle torque" has both.
_WORDS = {
    "t": r"\b(time|t|zeit|tijd|temps|timestamps?|x[ _]value|elapsed|sec(onds)?)\b",
    "velocity": r"vel(ocity)?\b|speed|omega|geschwindigkeit|snelheid|vitesse|angvel|\bdpos",
    "acceleration": r"acc(el|eleration)?\b|beschleunigung|versnelling",
    "torque": r"torq|\btrq|\btq\b|moment|mom\b|koppel|couple|drehm",
    "position": r"angle|pos(ition)?\b|\bpos|winkel|hoek|theta|rotation|encoder|flexion|\bang\b",
}
_REFERENCE = r"ref(erence)?\b|\bref|command|\bcmd|target|set ?point|desired|soll|doel|stimulus"
_MUSCLES = {
    "SOL": r"\bsol\b|soleus",
    "TA": r"\bta\b|tibialis|tib ?ant",
    "GL": r"\b(gl|lg|gasl|lgas|lgm)\b|gas\w* ?lat|lat\w* ?gas",
    "GM": r"\b(gm|mg|gasm|mgas|mgm)\b|gas\w* ?med|med\w* ?gas",
}
_NO_SIGNAL = r"frame|index|count|sample ?(no|number|nr)|\brow\b|trial|marker|event|trigger"
_TYPICAL_INERTIA = 0.013
"""[kg.m^2] The paper's ankle; of two readings that are possible the nearer one is likelier."""
_EMG_RMS = (1e-7, 2e-3)
"""[V] Rms of surface EMG, from a relaxed to a maximally contracted muscle."""
_MIN_MOVEMENT = 1e-3
"""[rad] Movements that show an ankle's mechanics are larger; position noise alone is below."""
_MAX_UNNAMED = 6
"""Columns without names that are tried as position and torque, each with each."""
_POSITION_UNITS = ("deg", "rad", "mrad")
_TORQUE_UNITS = ("N.m", "mN.m", "N.cm", "kN.m")
_TIME_UNITS = ("s", "ms", "us")
_LIKELY_RATE = (50.0, 20_000.0)  # Hz


@dataclass
class Proposal:
    """Holds a mapping that is likely, and why.

    Attributes
    ----------
    columns
        Stated name with unit -> column of the file, as `import_recording` takes it.
    rate
        Sampling rate [Hz] to state; None where the time column gives it.
    torque_sign
        ``rig`` or ``subject``; None without torque.
    resample
        Rate [Hz] of an even grid; None where the sampling is regular.
    reasons
        One sentence for each part.
    doubts
        What is a guess or could not be settled, one sentence each.
    """

    columns: dict[str, str] = field(default_factory=dict)
    rate: float | None = None
    torque_sign: str | None = None
    resample: float | None = None
    reasons: list[str] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)

    def command(self, source: Path | str, out: Path | str) -> str:
        """Return the command line to type."""
        parts = ["ankle", "import", str(source), "--out", str(out)]
        for name, column in self.columns.items():
            parts += ["--column", f"{name}={column}"]
        if self.torque_sign:
            parts += ["--torque-sign", self.torque_sign]
        if self.rate:
            parts += ["--rate", f"{self.rate:.10g}"]
        if self.resample:
            parts += ["--resample", f"{self.resample:.10g}"]
        return shlex.join(parts)


def propose(table: Table) -> Proposal:
    """Propose what the columns of a table are.

    Parameters
    ----------
    table
        Of any file.

    Raises
    ------
    ImportRefused
        Nothing looks like a position, a torque or EMG, or nothing gives the time; the message says
        what to state.
    """
    proposal = Proposal()
    found = _by_name(table, proposal)
    sampling = _time(table, found, proposal)
    if "torque" not in found and "position" not in found:
        _by_data(table, found, sampling, proposal)
    _mechanics(table, found, sampling, proposal)
    _emg(table, found, proposal)
    if not any(not name.startswith("t[") for name in proposal.columns):
        raise ImportRefused(
            f"{table.source}: no column looks like a position, a torque or EMG; it holds "
            f"{', '.join(table.names)}. State them, as in --column 'position[deg]=NAME' --column "
            "'torque[N.m]=NAME'"
        )
    return proposal


def _plain(name: str) -> str:
    """Return a column's name as words."""
    text = split_header(name)[0]
    text = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)
    return re.sub(r"[^0-9a-zäöüé]+", " ", text.lower()).strip()


def _by_name(table: Table, proposal: Proposal) -> dict[str, str]:
    """Return columns whose name says what they are, by quantity."""
    candidates: dict[str, list[str]] = {}
    for name in table.columns:
        quantity = _quantity(name, table.units.get(name))
        if quantity is not None:
            candidates.setdefault(quantity, []).append(name)
    found = {}
    for quantity, names in candidates.items():
        # "Ankle angle" before "knee angle"; then the file's order.
        names.sort(key=lambda name: ("ankle" not in name.lower(), "knee" in name.lower()))
        found[quantity] = names[0]
        if len(names) > 1:
            others = ", ".join(f"'{name}'" for name in names[1:4])
            proposal.doubts.append(f"{quantity} is taken from '{names[0]}', not from {others}")
    return found


def _quantity(name: str, unit: str | None) -> str | None:
    words = _plain(name)
    for muscle, pattern in _MUSCLES.items():
        if re.search(pattern, words) and (unit is None or unit in ("V", "mV", "uV")):
            return muscle
    said = next((key for key, pattern in _WORDS.items() if re.search(pattern, words)), None)
    if said is None and re.search(_NO_SIGNAL, words):
        return None
    by_unit = _quantity_of_unit(unit)
    if by_unit is not None and by_unit != said:
        # The unit is surer than a word: "reference [N.m]", "ankle [deg]".
        said = by_unit if said is None or by_unit != "position" else said
        if unit and _quantity_of_unit(unit) != said:
            return None
    if said is None:
        return None
    if re.search(_REFERENCE, words):
        return f"reference_{said}" if said in ("position", "velocity", "acceleration") else None
    return None if said == "acceleration" else said


def _quantity_of_unit(unit: str | None) -> str | None:
    if unit is None:
        return None
    try:
        si = to_si(unit)[0]
    except ValueError:
        return None
    return {
        "s": "t",
        "rad": "position",
        "rad/s": "velocity",
        "rad/s^2": "acceleration",
        "N.m": "torque",
    }.get(si)


def _time(table: Table, found: dict[str, str], proposal: Proposal) -> Sampling:
    name = found.pop("t", None) or _counting_column(table)
    if name is not None:
        times = table.columns[name][np.isfinite(table.columns[name])]
        unit = table.units.get(name) or _time_unit(times)
        if unit is not None and len(times) > 1:
            try:
                sampling = judge_times(times * to_si(unit)[1])
            except ValueError as error:
                raise ImportRefused(
                    f"{table.source}: '{name}' looks like the time, but {error}; state the "
                    "sampling rate instead: --rate HZ"
                ) from None
            proposal.columns[f"t[{unit}]"] = name
            proposal.reasons.append(
                f"'{name}' is the time in {unit}: it steps at {sampling.rate:.6g} Hz"
            )
            if sampling.kind == "irregular":
                proposal.resample = sampling.rate
            if sampling.sentence:
                proposal.doubts.append(sampling.sentence)
            return sampling
    rate = next(iter(table.rates.values()), None)
    if rate is not None:
        if TIME not in table.columns:
            proposal.columns["t[s]"] = TIME
        proposal.reasons.append(f"the file states a sampling rate of {rate:.6g} Hz")
        return Sampling("regular", rate)
    if table.rate is not None:
        proposal.rate = table.rate
        proposal.reasons.append(f"the file's header states a sampling rate of {table.rate:.6g} Hz")
        return Sampling("regular", table.rate)
    raise ImportRefused(
        f"{table.source}: no column looks like the time and the file states no sampling rate; it "
        f"holds {', '.join(table.names)}. State the rate, as in --rate 2048"
    )


def _counting_column(table: Table) -> str | None:
    """Return a column that can only be time: it rises in even steps of a plausible size."""
    for name, values in table.columns.items():
        if name in table.rates or re.search(_NO_SIGNAL, _plain(name)) or len(values) < 100:
            continue
        steps = np.diff(values)
        if not np.isfinite(steps).all() or np.any(steps <= 0):
            continue
        step = float(np.median(steps))
        if np.max(np.abs(steps - step)) < 0.1 * step and _time_unit(values) is not None:
            return name
    return None


def _time_unit(times: np.ndarray) -> str | None:
    """Return the unit in which a column of times has a likely rate; None for a counter."""
    if len(times) < 2:
        return None
    steps = np.diff(times)
    step = float(np.mean(steps[steps > 0])) if np.any(steps > 0) else 0.0
    if step <= 0 or (step == 1.0 and np.array_equal(times, np.round(times))):
        return None
    for unit in _TIME_UNITS:
        if _LIKELY_RATE[0] <= 1.0 / (step * to_si(unit)[1]) <= _LIKELY_RATE[1]:
            return unit
    return None


def _even(
    table: Table, names: Iterable[str], sampling: Sampling, proposal: Proposal
) -> dict[str, np.ndarray]:
    """Return columns as they would be imported: evenly spaced, NaN where time has a gap."""
    columns = {name: table.columns[name] for name in names}
    time_name = next((c for n, c in proposal.columns.items() if n.startswith("t[")), None)
    if time_name is None or time_name not in table.columns:
        return columns
    unit = next(n for n in proposal.columns if n.startswith("t["))[2:-1]
    time = table.columns[time_name] * to_si(unit)[1]
    if any(len(values) != len(time) for values in columns.values()):
        return columns
    if sampling.kind == "irregular":
        order = np.argsort(time, kind="stable")
        order = order[np.isfinite(time[order])]
        if len(order) < 2 or (time[order[-1]] - time[order[0]]) * sampling.rate > MAX_GRID:
            return columns
        grid = np.arange(time[order[0]], time[order[-1]], 1.0 / sampling.rate)
        return {name: np.interp(grid, time[order], v[order]) for name, v in columns.items()}
    if sampling.kind == "rounded":
        return columns
    jumps = np.abs(np.diff(time, prepend=time[0] - 1.0 / sampling.rate) * sampling.rate - 1) > 0.5
    return {name: np.where(jumps, np.nan, values) for name, values in columns.items()}


def _by_data(table: Table, found: dict[str, str], sampling: Sampling, proposal: Proposal) -> None:
    """Find position and torque among columns whose names say nothing.

    They are the pair that an ankle explains best.
    """
    used = {*found.values(), *proposal.columns.values()}
    free = [name for name in table.columns if name not in used][:_MAX_UNNAMED]
    even = _even(table, free, sampling, proposal)
    best: tuple[float, str, str] | None = None
    for position, torque in permutations(free, 2):
        if len(even[position]) != len(even[torque]):
            continue
        for fit, _, _ in _readings(even[position], even[torque], None, None, sampling.rate):
            if best is None or fit.explained > best[0]:
                best = (fit.explained, position, torque)
    if best is not None:
        found["position"], found["torque"] = best[1], best[2]
        proposal.doubts.append(
            f"names do not tell: '{best[1]}' moves and '{best[2]}' answers as an ankle's angle and "
            f"torque do ({100 * best[0]:.0f} % explained)"
        )


def _readings(
    position: np.ndarray,
    torque: np.ndarray,
    position_unit: str | None,
    torque_unit: str | None,
    rate: float,
) -> Iterator[tuple[Intrinsic, str, str]]:
    """Return units of position and torque in which an ankle is possible."""
    fit = intrinsic(rate, position, torque)
    if fit is None or abs(fit.inertia) < CERTAIN * fit.inertia_error:
        return
    for angle in (position_unit,) if position_unit else _POSITION_UNITS:
        for force in (torque_unit,) if torque_unit else _TORQUE_UNITS:
            inertia = abs(fit.inertia) * to_si(force)[1] / to_si(angle)[1]
            if not INERTIA_RANGE[0] <= inertia <= INERTIA_RANGE[1]:
                continue
            if (
                _possible_angle(position, angle)
                and _largest(torque) * to_si(force)[1] <= LARGEST_TORQUE
            ):
                yield fit, angle, force


def _largest(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.max(np.abs(finite))) if len(finite) else 0.0


def _possible_angle(values: np.ndarray, unit: str) -> bool:
    factor = to_si(unit)[1]
    finite = values[np.isfinite(values)]
    return bool(
        not len(finite)
        or (
            np.ptp(finite) * factor <= LARGEST_SPREAD
            and np.ptp(finite) * factor >= _MIN_MOVEMENT
            and _largest(finite) * factor <= LARGEST_POSITION
        )
    )


def _mechanics(table: Table, found: dict[str, str], sampling: Sampling, proposal: Proposal) -> None:
    mechanical = {
        quantity: name
        for quantity, name in found.items()
        if quantity in ("position", "velocity", "torque") or quantity.startswith("reference_")
    }
    even = _even(table, mechanical.values(), sampling, proposal)
    position, torque = mechanical.get("position"), mechanical.get("torque")
    angle_unit = table.units.get(position or "")
    torque_unit = table.units.get(torque or "")
    fit = None
    if position and torque and len(even[position]) == len(even[torque]):
        readings = sorted(
            _readings(even[position], even[torque], angle_unit, torque_unit, sampling.rate),
            key=lambda r: abs(
                np.log(abs(r[0].inertia) * to_si(r[2])[1] / to_si(r[1])[1] / _TYPICAL_INERTIA)
            ),
        )
        if readings:
            fit, angle, force = readings[0]
            inertia = abs(fit.inertia) * to_si(force)[1] / to_si(angle)[1]
            if angle_unit is None or torque_unit is None:
                proposal.reasons.append(
                    f"position in {angle} and torque in {force} give an inertia of {inertia:.3g} "
                    "kg.m^2, as an ankle has"
                )
                if len(readings) > 1:
                    proposal.doubts.append(
                        f"position in {readings[1][1]} and torque in {readings[1][2]} would be "
                        "possible as well"
                    )
            angle_unit, torque_unit = angle, force
    if position:
        unit = angle_unit or _guess_angle(even[position], position, proposal)
        _state(proposal, "position", unit, position, table)
        angle_unit = unit
    if velocity := mechanical.get("velocity"):
        _velocity(table, velocity, even, position, angle_unit, sampling, proposal)
    for quantity in ("reference_position", "reference_velocity", "reference_acceleration"):
        if (name := mechanical.get(quantity)) is not None:
            power = {"position": "", "velocity": "/s", "acceleration": "/s^2"}[quantity[10:]]
            unit = table.units.get(name) or f"{(angle_unit or 'rad').replace('mrad', 'rad')}{power}"
            _state(proposal, quantity, unit, name, table)
    if torque:
        _torque(table, torque, torque_unit, fit, proposal)


def _state(proposal: Proposal, quantity: str, unit: str, name: str, table: Table) -> None:
    proposal.columns[f"{quantity}[{unit}]"] = name
    if name in table.units:
        proposal.reasons.append(f"'{name}' is {quantity}: its name or the file says so, in {unit}")


def _guess_angle(values: np.ndarray, name: str, proposal: Proposal) -> str:
    unit = next((unit for unit in ("rad", "deg", "mrad") if _possible_angle(values, unit)), "rad")
    proposal.doubts.append(
        f"'{name}' states no unit; {unit} is possible by its size ({_largest(values):.3g})"
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
                for u in _TORQUE_UNITS
                if _largest(table.columns[name]) * to_si(u)[1] <= LARGEST_TORQUE
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
    proposal.torque_sign = "rig" if fit.inertia > 0 else "subject"
    proposal.reasons.append(
        f"the torque has the {proposal.torque_sign}'s sign: with it the inertia is positive"
    )


def _emg(table: Table, found: dict[str, str], proposal: Proposal) -> None:
    for muscle in _MUSCLES:
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
                    and _largest(values) * to_si(u)[1] <= LARGEST_EMG
                ),
                None,
            )
            if unit is None:
                proposal.doubts.append(f"'{name}' is left out: {rms:.3g} rms is no EMG in V to uV")
                continue
            proposal.doubts.append(f"'{name}' states no unit; {rms:.3g} rms is EMG in {unit}")
        _state(proposal, muscle, unit, name, table)
