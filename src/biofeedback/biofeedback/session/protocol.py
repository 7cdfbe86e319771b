"""A session protocol: blocks, breaks, holds and their targets, from a YAML file.

A block is a list of holds. Each hold is preceded by the way to it (reach); before the first block
the subject relaxes for a baseline, from which axes and levels come. `config/van_t_veld_2018.yaml`
is the paper's; `docs/biofeedback.md` explains every key.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from biofeedback.errors import ProtocolError
from biofeedback.session.check_list import CALIBRATE_RIG, SESSION_CALIBRATION, checked_names
from biofeedback.session.plan_file import check_keys, load_plan
from perturbation_generator.rig_calibration import DURATION

BASELINE, REACH, HOLD, BREAK, TRIALS = "baseline", "reach", "hold", "break", "trials"
CALIBRATION, RIG_CALIBRATION = "calibration", "rig_calibration"
UNITS = {"K": "N.m/rad", "G": "N.m.s/rad"}
PAPER = "van_t_veld_2018"
_LIMITS = {
    "calibration[s]": (30.0, 600.0),
    "diagnosis[min]": (1.0, 60.0),
    "baseline[s]": (1.0, 600.0),
    "reach[s]": (0.0, 600.0),
    "hold[s]": (1.0, 600.0),
    "break[s]": (0.0, 3600.0),
    "torque_half_width[N.m]": (0.05, 20.0),
    "level_half_width[1]": (0.01, 2.0),
    "torque_target[N.m]": (-30.0, 30.0),
    "level[1]": (0.05, 10.0),
    "amplitude[rad]": (0.005, 0.1),
    "spring[N.m/rad]": (0.0, 1000.0),
}
"""Ranges [unit of the key]: beyond, a slip of the keyboard is more likely than a plan."""
_HOLD_KEYS = ("torque_target[N.m]", "level[1]")


@dataclass(frozen=True)
class Step:
    """Describes one step of a session: a break or a hold.

    Attributes
    ----------
    kind
        `CALIBRATION`, `BASELINE`, `REACH`, `HOLD`, `BREAK`, `TRIALS` of a conditioning course, or
        `RIG_CALIBRATION`.
    duration
        [s]; of a calibration, what is recorded: the step ends with the calibration.
    block
        Counted from 1; of a break, the one before it.
    hold
        Number of the hold, counted through the session from 1; 0 for baseline and break.
    feedback
        ``K`` or ``G``.
    torque_target
        [N.m], the subject's torque, plantarflexion negative.
    level
        Target of the feedback in baselines; None where there is none.
    """

    kind: str
    duration: float
    block: int
    hold: int
    feedback: str
    torque_target: float
    level: float | None


@dataclass(frozen=True)
class RigMovement:
    """Describes the movement that calibrates a rig.

    Attributes
    ----------
    amplitude
        Largest distance of the plate from rest [rad].
    spring
        Stiffness of the known spring on the plate [N.m/rad]; 0 where there is none.
    rig
        Name of the rig, free text.
    """

    amplitude: float
    spring: float
    rig: str


@dataclass(frozen=True)
class Protocol:
    """Describes the plan of a session: blocks, breaks, holds and targets, or a rig's calibration.

    Attributes
    ----------
    title
        Free text.
    steps
        In order.
    torque_half_width
        Of the torque band [N.m].
    level_half_width
        Of the feedback's region, in baselines.
    digest
        Tells one protocol from another.
    check_list
        Names of the checks before the first block, see `check_list`.
    rig_movement
        Where a rig is calibrated; None in a session with a subject.
    diagnosis_minutes
        Time after which the calibration of the session adds no further terms to its model [min];
        None for no limit.
    """

    title: str
    steps: tuple[Step, ...]
    torque_half_width: float
    level_half_width: float
    digest: str
    check_list: tuple[str, ...] = ()
    rig_movement: RigMovement | None = None
    diagnosis_minutes: float | None = None

    @property
    def targets(self) -> list[float]:
        """Return every torque target [N.m]."""
        return sorted({step.torque_target for step in self.steps})

    @property
    def blocks(self) -> int:
        """Return the number of blocks."""
        return max(step.block for step in self.steps)

    @property
    def holds(self) -> int:
        """Return the number of holds."""
        return max(step.hold for step in self.steps)

    def trials_from(self, block: int) -> int:
        """Return the index of the first step with trials of this block or a later one."""
        return next(
            (
                index
                for index, step in enumerate(self.steps)
                if step.kind == TRIALS and step.block >= block
            ),
            len(self.steps) - 1,
        )

    def has(self, kind: str) -> bool:
        """Tell whether a step is of this kind."""
        return any(step.kind == kind for step in self.steps)

    @property
    def duration(self) -> float:
        """Return the duration of all steps together [s]."""
        return sum(step.duration for step in self.steps)


def load_protocol(name: str) -> Protocol:
    """Load a protocol by the name of one in the package, or by the path of a YAML file.

    Raises
    ------
    ProtocolError
        No such file, not YAML, a key that is missing, unknown or out of range.
    """
    content, digest = load_plan(name, "config", "protocol")
    if isinstance(content, dict) and RIG_CALIBRATION in content:
        return _rig_calibration(content, name, digest)
    return _protocol(content, name, digest)


def _rig_calibration(content: dict[str, Any], name: str, digest: str) -> Protocol:
    check_keys(content, {RIG_CALIBRATION, "check_list", "title"}, {"title"}, name)
    where, optional = f"{name}: {RIG_CALIBRATION}", {"spring[N.m/rad]", "rig"}
    asked = content[RIG_CALIBRATION]
    check_keys(asked, {"amplitude[rad]", *optional}, optional, where)
    spring = _number(asked, "spring[N.m/rad]", where) if "spring[N.m/rad]" in asked else 0.0
    movement = RigMovement(_number(asked, "amplitude[rad]", where), spring, asked.get("rig") or "")
    checks = checked_names(content["check_list"], name)
    if CALIBRATE_RIG not in checks:
        raise ProtocolError(f"{where} needs the check '{CALIBRATE_RIG}' in 'check_list'")
    step = Step(RIG_CALIBRATION, DURATION, 1, 0, "K", 0.0, None)
    title = str(content.get("title") or name)
    return Protocol(title, (step,), 1.0, 1.0, digest, checks, movement)


def _protocol(content: Any, name: str, digest: str) -> Protocol:
    top = (
        "baseline[s]",
        "reach[s]",
        "hold[s]",
        "break[s]",
        "torque_half_width[N.m]",
        "level_half_width[1]",
    )
    optional = {"title", "check_list", "calibration[s]", "diagnosis[min]"}
    check_keys(content, {"blocks", *top, *optional}, optional, name)
    durations = {key: _number(content, key, name) for key in top}
    if not isinstance(content["blocks"], list) or not content["blocks"]:
        raise ProtocolError(f"{name}: 'blocks' is a list of at least one block")
    steps: list[Step] = []
    hold_number = 0
    for number, block in enumerate(content["blocks"], start=1):
        where = f"{name}: block {number}"
        check_keys(
            block, {"feedback", "holds", "reach[s]", "hold[s]"}, {"reach[s]", "hold[s]"}, where
        )
        feedback = block["feedback"]
        if not isinstance(feedback, str) or feedback not in UNITS:
            raise ProtocolError(f"{where}: feedback = {feedback!r} is refused; allowed: K or G")
        if not isinstance(block["holds"], list) or not block["holds"]:
            raise ProtocolError(f"{where}: 'holds' is a list of at least one hold")
        lengths = {
            key: _number(block, key, where) if key in block else durations[key]
            for key in ("reach[s]", "hold[s]")
        }
        if number == 1:
            if "calibration[s]" in content:
                seconds = _number(content, "calibration[s]", name)
                steps.append(Step(CALIBRATION, seconds, 1, 0, feedback, 0.0, None))
            steps.append(Step(BASELINE, durations["baseline[s]"], 1, 0, feedback, 0.0, None))
        else:
            steps.append(Step(BREAK, durations["break[s]"], number - 1, 0, feedback, 0.0, None))
        for hold in block["holds"]:
            hold_number += 1
            which = f"{where}, hold {hold_number}"
            check_keys(hold, set(_HOLD_KEYS), set(), which)
            target, level = (_number(hold, key, which) for key in _HOLD_KEYS)
            steps.append(
                Step(REACH, lengths["reach[s]"], number, hold_number, feedback, target, level)
            )
            steps.append(
                Step(HOLD, lengths["hold[s]"], number, hold_number, feedback, target, level)
            )
    checks = checked_names(content.get("check_list", []), name)
    if "calibration[s]" in content and SESSION_CALIBRATION not in checks:
        raise ProtocolError(
            f"{name}: 'calibration[s]' needs the check '{SESSION_CALIBRATION}' in 'check_list'"
        )
    minutes = None
    if "diagnosis[min]" in content:
        minutes = _number(content, "diagnosis[min]", name)
        if "calibration[s]" not in content:
            raise ProtocolError(f"{name}: 'diagnosis[min]' needs 'calibration[s]'")
    return Protocol(
        str(content.get("title") or name),
        tuple(steps),
        durations["torque_half_width[N.m]"],
        durations["level_half_width[1]"],
        digest,
        checks,
        diagnosis_minutes=minutes,
    )


def _number(content: dict[str, Any], key: str, where: str) -> float:
    value, (lower, upper) = content[key], _LIMITS[key]
    if (
        isinstance(value, bool)
        or not isinstance(value, (int, float))
        or not lower <= value <= upper
    ):
        raise ProtocolError(
            f"{where}: {key} = {value!r} is refused; allowed: {lower:g} to {upper:g}"
        )
    return float(value)
