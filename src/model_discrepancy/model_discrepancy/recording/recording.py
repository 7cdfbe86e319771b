"""A recording of one trial: position and torque of the joint on a common clock, and what else was
recorded.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ankle_interfaces.block import Block, require_columns
from ankle_interfaces.continuity import sampling_rate
from ankle_interfaces.errors import BlockError, UnitError
from ankle_interfaces.topics import ANKLE_SAMPLES, EMG_SAMPLES, PERTURBATION_REFERENCE
from ankle_physics.joint_profile import joint_in_force
from model_discrepancy.errors import DiagnosisError
from session_recorder.bag_reader import BagReader
from session_recorder.errors import BagError
from session_recorder.loss import account_of_bag

SAMPLES_TOPIC = ANKLE_SAMPLES.absolute
REFERENCE_TOPIC = PERTURBATION_REFERENCE.absolute
EMG_TOPIC = EMG_SAMPLES.absolute
# Rates below this do not hold the reflex's onset (milliseconds) nor the band up to 80 Hz that is
# fitted.
LOWEST_RATE = 250.0
# A reflex response lasts about 0.4 s: a longer hole cannot be bridged, and 2 % of holes spoil the
# filters.
LONGEST_HOLE_S, LARGEST_HOLE_SHARE = 0.4, 0.02


@dataclass(frozen=True)
class Recording:
    """Holds one trial, equally sampled, in SI, positive in dorsiflexion.

    Torque is what is needed to move the ankle.

    Attributes
    ----------
    rate
        Sampling rate [Hz].
    position
        [rad], shape (n,).
    torque
        [N.m], shape (n,).
    velocity
        [rad/s], shape (n,), where it was measured.
    reference
        Commanded position [rad], shape (n,), where it was recorded.
    emg
        EMG by muscle [V], each of shape (n,).
    name
        What reports call it.
    start
        Time of the first sample [s].
    notes
        What was converted, filled or found odd on the way here, one sentence each.
    faults
        What makes the recording unusable, one sentence each.
    holes
        Begin and end of each pause in the samples, bridged linearly, since the first sample [s].
    """

    rate: float
    position: np.ndarray
    torque: np.ndarray
    velocity: np.ndarray | None = None
    reference: np.ndarray | None = None
    emg: Mapping[str, np.ndarray] = field(default_factory=dict)
    name: str = "recording"
    start: float = 0.0
    notes: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    holes: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        n = len(self.position)
        for label, values in (
            ("torque", self.torque),
            ("velocity", self.velocity),
            ("reference", self.reference),
            *self.emg.items(),
        ):
            if values is not None and len(values) != n:
                raise DiagnosisError(f"{label} has {len(values)} samples, position has {n}")
        if not self.rate >= LOWEST_RATE:
            raise DiagnosisError(
                f"sampling rate {self.rate:g} Hz is below {LOWEST_RATE:g} Hz, the least"
            )

    @classmethod
    def unreadable(cls, path: str | Path, reason: str) -> Recording:
        """Return a placeholder for a bag whose samples cannot be used at all."""
        return cls(LOWEST_RATE, np.zeros(0), np.zeros(0), name=Path(path).name, faults=(reason,))

    @property
    def duration(self) -> float:
        """Return the length [s]."""
        return len(self.position) / self.rate

    @property
    def time(self) -> np.ndarray:
        """Return the time since the first sample [s], shape (n,)."""
        return np.arange(len(self.position)) / self.rate

    def channels(self) -> dict[str, np.ndarray]:
        """Return what the rig measured, by name with unit, each of shape (n,)."""
        joint = joint_in_force()
        channels = {joint.position_column: self.position, joint.torque_column: self.torque}
        if self.velocity is not None:
            channels[joint.velocity_column] = self.velocity
        return channels

    def longest_stretch(self) -> Recording:
        """Return the longest part between holes, without the fault that they are; the recording
        itself where it has no fault or others.
        """
        if not self.holes or len(self.faults) != 1 or self.faults[0] != _fault_of(self.holes):
            return self
        ends = np.array([0.0, *np.ravel(self.holes), self.duration])
        begin, end = max(ends.reshape(-1, 2), key=lambda part: part[1] - part[0])
        # A hole ends with a sample and begins with one.
        part = slice(round(begin * self.rate), round(end * self.rate) + 1)
        return replace(
            self,
            position=self.position[part],
            torque=self.torque[part],
            velocity=None if self.velocity is None else self.velocity[part],
            reference=None if self.reference is None else self.reference[part],
            emg={muscle: values[part] for muscle, values in self.emg.items()},
            start=self.start + float(begin),
            faults=(),
            holes=(),
        )

    @classmethod
    def from_bag(cls, path: str | Path) -> Recording:
        """Read the trial in a bag: ``/ankle/samples``, and reference and EMG where they were
        recorded.

        Columns and units are those of the joint in force.

        Raises
        ------
        BagError
            No bag.
        DiagnosisError
            Topic or channel is missing or in a unit that cannot be converted, or too few samples.
        """
        bag = BagReader(path)
        joint = joint_in_force()
        position, torque, velocity = (
            joint.position_column,
            joint.torque_column,
            joint.velocity_column,
        )
        try:
            names, data = bag.signal(SAMPLES_TOPIC)
        except BagError as error:
            raise DiagnosisError(str(error)) from None
        given = Block(names, data)
        try:
            converted, notes = given.in_si()
            samples = require_columns(converted, (position, torque), SAMPLES_TOPIC)
        except (BlockError, UnitError) as error:
            raise DiagnosisError(f"{path}: {error}") from None
        notes = [*account_of_bag(bag).sentences(), *notes]
        faults: list[str] = []
        clock = samples.time
        if len(clock) < 2:
            raise DiagnosisError(f"{path}: {SAMPLES_TOPIC} holds {len(clock)} sample(s)")
        if not np.isfinite(clock).all():
            raise DiagnosisError(
                f"{path}: {int(np.sum(~np.isfinite(clock)))} time(s) of {SAMPLES_TOPIC} are not "
                "finite"
            )
        rate = sampling_rate(clock)
        columns = [samples.column(position), samples.column(torque)]
        if converted.has(velocity):
            columns.append(converted.column(velocity))
        grid, values, holes = _on_grid(clock, np.column_stack(columns), rate, faults)
        return cls(
            rate=rate,
            position=values[:, 0],
            torque=values[:, 1],
            velocity=values[:, 2] if values.shape[1] > 2 else None,
            reference=_other_clock(bag, REFERENCE_TOPIC, (position,), grid, notes).get("position"),
            emg=_other_clock(bag, EMG_TOPIC, None, grid, notes),
            name=Path(path).name,
            start=float(grid[0]),
            notes=tuple(notes),
            faults=tuple(faults),
            holes=holes,
        )


def _on_grid(
    clock: np.ndarray, values: np.ndarray, rate: float, faults: list[str]
) -> tuple[np.ndarray, np.ndarray, tuple[tuple[float, float], ...]]:
    """Return the samples on an equally spaced clock, and its holes; these are bridged linearly,
    long ones are a fault.
    """
    steps = np.diff(clock)
    backwards = int(np.sum(steps <= 0))
    if backwards:
        faults.append(f"time stands still or runs backwards at {backwards} sample(s)")
        order = np.argsort(clock, kind="stable")
        keep = np.concatenate([[True], np.diff(clock[order]) > 0])
        clock, values = clock[order][keep], values[order][keep]
    pauses = np.flatnonzero(np.diff(clock) > 1.5 / rate)
    if not len(pauses):
        return clock[0] + np.arange(len(clock)) / rate, values, ()
    since = clock - clock[0]
    holes = tuple((float(since[k]), float(since[k + 1])) for k in pauses)
    lengths = np.diff(holes)
    lost = float(np.sum(lengths - 1.0 / rate))
    if lengths.max() > LONGEST_HOLE_S or lost > LARGEST_HOLE_SHARE * since[-1]:
        faults.append(_fault_of(holes))
    grid = np.arange(clock[0], clock[-1] + 0.25 / rate, 1.0 / rate)
    on_grid = np.column_stack([np.interp(grid, clock, column) for column in values.T])
    return grid, on_grid, holes


def _fault_of(holes: tuple[tuple[float, float], ...]) -> str:
    lengths = np.diff(holes)
    return (
        f"{len(holes)} gap(s) in the samples, {lengths.sum():.3f} s in all, the longest "
        f"{lengths.max():.3f} s"
    )


def _other_clock(
    bag: BagReader, topic: str, required: tuple[str, ...] | None, grid: np.ndarray, notes: list[str]
) -> dict[str, np.ndarray]:
    """Return the columns of another topic, interpolated to the samples' clock, by name without
    unit; empty where it is missing.
    """
    if topic not in bag.topics or not bag.topics[topic].count:
        return {}
    try:
        block = Block(*bag.signal(topic)).in_si()[0]
        if required is not None:
            block = require_columns(block, required, topic)
    except (BlockError, UnitError) as error:
        notes.append(f"{topic} is left out: {error}")
        return {}
    order = np.argsort(block.time, kind="stable")
    overlap = min(block.time[order[-1]], grid[-1]) - max(block.time[order[0]], grid[0])
    if overlap < 0.9 * (grid[-1] - grid[0]):
        notes.append(
            f"{topic} covers {max(overlap, 0.0):.1f} s of {grid[-1] - grid[0]:.1f} s and is left "
            "out"
        )
        return {}
    return {
        name.split("[")[0]: np.interp(grid, block.time[order], block.column(name)[order])
        for name in block.columns[1:]
    }
