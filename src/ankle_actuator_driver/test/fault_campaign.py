"""Faults at random moments of a running rig, in virtual time: what was promised, what happened.

    make faults                      all faults, 10 times each; writes docs/reliability.md
    python fault_campaign.py --times 2 --only torque

For each fault: motion that the servo was told beyond a limit, samples lost as counted from end to
end and as reported by the driver, time from the fault to the plate at rest, and time from the end
of the fault to a running plate. The command ends with 1 where a promise was broken.
"""

from __future__ import annotations

import argparse
import copy
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from virtual_laboratory import BLOCK, EPOCH, RATE, VirtualLaboratory

from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings
from rig_emulator.faults import Faults

PAGE = Path(__file__).resolve().parents[3] / "docs" / "reliability.md"
LIMITS = np.array([0.175, 5.0, 2000.0]) * (1 + 1e-5)  # rad, rad/s, rad/s^2
LASTS = 0.6  # s; of a fault that ends by itself
PATIENCE = 6.0  # s; to be running again
REST = 1e-3  # rad/s
LONGEST_TO_REST = 0.45  # s; a fault of a sensor shows within 0.2 s of the next movement
Laboratory = VirtualLaboratory


@dataclass(frozen=True)
class Fault:
    """One fault.

    Attributes
    ----------
    name
        For the table.
    promise
        ``goes on``, ``stops`` (and is ready), ``faults`` (and waits for a reset).
    begin, end
        What happens to the laboratory.
    """

    name: str
    promise: str
    begin: Callable[[Laboratory], None]
    end: Callable[[Laboratory], None] = lambda lab: lab.faults()


def switch(**switches: float) -> Callable[[Laboratory], None]:
    """Faults of line, sensors and controller."""
    return lambda lab: lab.faults(**switches)


def line(up: float = 1.0, down: float = 1.0, **switches: float) -> Callable[[Laboratory], None]:
    """Faults of the line, each way."""

    def begin(lab: Laboratory) -> None:
        lab.up.faults = Faults(**{name: up * value for name, value in switches.items()})
        lab.down.faults = Faults(**{name: down * value for name, value in switches.items()})

    return begin


def attribute(name: str, value: object, after: object) -> tuple[Callable, Callable]:
    """Set an attribute of the laboratory and set it back."""
    return (lambda lab: setattr(lab, name, value)), (lambda lab: setattr(lab, name, after))


def new_driver(lab: Laboratory) -> None:
    """The driver is killed and started again."""
    lab.new_driver(lab.bridge_number + 1)
    lab.bridge_number += 1


def new_rig(lab: Laboratory) -> None:
    """The rig's controller restarts."""
    old = lab.device
    lab.device = type(old)(lab.plant, lab.limits, RATE, old._session + 1, lab.rig_time)
    lab.device.command = (old.command[0], 0.0, 0.0)
    lab.device.commands, lab.device.velocities = old.commands, old.velocities


def new_generator(lab: Laboratory) -> None:
    """The perturbation begins from its start."""
    lab.signal = PulseStep(Settings(rate=RATE, seed=4))


def ros_time(seconds: float) -> Callable[[Laboratory], None]:
    """ROS time is set."""

    def begin(lab: Laboratory) -> None:
        lab.epoch += seconds
        lab.reference_shift += seconds

    return begin


def rig_clock(seconds: float) -> Callable[[Laboratory], None]:
    """The rig's clock is set."""

    def begin(lab: Laboratory) -> None:
        lab.offset += seconds
        lab.device._begin += seconds

    return begin


def blocks(kind: str) -> Callable[[Laboratory], None]:
    """Blocks of the reference on their way to the driver are lost, doubled or reordered."""
    return lambda lab: setattr(lab, "mischief", kind)


FAULTS = (
    Fault("driver stopped (SIGSTOP), goes on", "faults", *attribute("hearing", False, True)),
    Fault("driver killed and restarted", "faults", new_driver, lambda lab: None),
    Fault("driver's packets stay away", "faults", *attribute("talking", False, True)),
    Fault("generator stopped", "stops", *attribute("sending", False, True)),
    Fault("generator killed and restarted", "faults", new_generator, lambda lab: None),
    Fault("rig's communication hangs", "faults", switch(freeze=1.0)),
    Fault("rig restarts", "faults", new_rig, lambda lab: None),
    Fault("rig ignores OFF (and a stop)", "faults", switch(ignore_off=1.0)),
    Fault("rig does not follow", "faults", switch(ignore_reference=1.0)),
    Fault(
        "emergency stop pressed",
        "faults",
        lambda lab: lab.device.press_emergency_stop(True, lab.rig_time),
        lambda lab: lab.device.press_emergency_stop(False, lab.rig_time),
    ),
    Fault("line cut both ways", "faults", line(drop=1.0)),
    Fault("line cut to the rig", "faults", line(up=0.0, drop=1.0)),
    Fault("line cut from the rig", "faults", line(down=0.0, drop=1.0)),
    Fault(
        "2 % of packets lost, 10 % doubled, 2 % damaged",
        "goes on",
        line(drop=0.02, duplicate=0.1, corrupt=0.02),
    ),
    Fault("bursts of 40 ms on the line", "goes on", line(burst=0.04)),
    Fault("blocks of the reference doubled", "goes on", blocks("doubled"), blocks("")),
    Fault("blocks of the reference reordered", "any", blocks("reordered"), blocks("")),
    Fault("one block of the reference in 20 lost", "any", blocks("lost"), blocks("")),
    Fault("ROS time set by +3 s", "faults", ros_time(3.0), lambda lab: None),
    Fault("ROS time set by -3 s", "faults", ros_time(-3.0), lambda lab: None),
    Fault("rig's clock set by +30 s", "faults", rig_clock(30.0), lambda lab: None),
    Fault("all channels NaN", "faults", switch(nan=1.0)),
    Fault("position stuck", "faults", switch(encoder_stuck=1.0)),
    Fault("position slips by 0.03 rad", "faults", switch(encoder_slip=0.03)),
    Fault("position spikes, 1 sample in 500", "any", switch(encoder_spikes=0.002)),
    Fault("velocity stuck", "faults", switch(velocity_stuck=1.0)),
    Fault("torque dead", "faults", switch(torque_dead=1.0)),
    Fault("torque saturated", "faults", switch(torque_saturated=1.0)),
    Fault("torque swings by 50 N.m", "faults", switch(torque_swings=0.5)),
    Fault("state packets without samples", "faults", switch(no_samples=1.0)),
)


class Campaign(VirtualLaboratory):
    """A laboratory whose reference can be tampered with."""

    mischief, reference_shift, bridge_number = "", 0.0, 4711
    kept: tuple = ()

    def _refer(self) -> None:
        while self._count * BLOCK / RATE < self.now + self.lead:
            time = EPOCH + self.reference_shift + (self._count * BLOCK + np.arange(BLOCK)) / RATE
            motion = self.signal.next(BLOCK)
            self._count += 1
            for block in self._tampered((time, motion)) if self.sending else ():
                self.bridge.reference(*block, self.now, self.ros)

    def _tampered(self, block: tuple) -> tuple:
        if self.mischief == "doubled":
            return (block, block)
        if self.mischief == "lost" and not self._count % 20:
            return ()
        if self.mischief == "reordered":
            kept, self.kept = self.kept, () if self.kept else (block,)
            return (block, *kept) if kept else ()
        return (block,)


@dataclass
class Outcome:
    """Of all cases of one fault."""

    states: list[str] = field(default_factory=list)
    rest: list[float] = field(default_factory=list)
    again: list[float] = field(default_factory=list)
    lost: int = 0
    reported: int = 0
    beyond: int = 0
    broken: list[str] = field(default_factory=list)


def recover(lab: Campaign) -> float:
    """Seconds until the plate runs again with an operator who resets, arms and starts at once."""
    began = lab.now
    commands = {"fault": "reset_fault", "ready": "arm", "armed": "start"}
    while lab.state != "running" and lab.now - began < PATIENCE:
        if lab.state in commands:
            lab.command(commands[lab.state])
        lab.run(0.01)
    return lab.now - began if lab.state == "running" else np.nan


def one_case(fault: Fault, prepared: Campaign, random: np.random.Generator, out: Outcome) -> None:
    """One fault at a random moment."""
    lab = copy.deepcopy(prepared)
    lab.device.commands, lab.device.velocities, lab.blocks = lab.device.commands[-1:], [], []
    lab.run(float(random.uniform(0.0, 0.6)))
    lab.until_moving(0.2)
    missing = lab.end.missing
    at = lab.rig_time
    fault.begin(lab)
    if "and a stop" in fault.name:
        lab.command("stop")
    lab.run(LASTS)
    fault.end(lab)
    lab.run(0.4)
    state = lab.state
    moved = lab.moves_until(at).max() if state != "running" else np.nan
    out.rest.append(moved)
    out.states.append(state)
    out.again.append(recover(lab) if state != "running" else 0.0)
    lab.run(0.3)
    commands = lab.commands()
    jumps = np.abs(np.diff(commands[:, 1])).max() > 1.03 * LIMITS[1] / RATE
    out.beyond += bool((np.abs(commands[:, 1:]).max(axis=0) > LIMITS).any() or jumps)
    count_lost(lab, missing, fault, out)
    if not np.isfinite(out.again[-1]):
        out.broken.append("not running again")
    kept = {"goes on": ("running",), "stops": ("ready", "stopping"), "faults": ("fault",)}
    if state not in kept.get(fault.promise, (state,)):
        out.broken.append(f"was {state}: {lab.bridge.states.reason}")


def count_lost(lab: Campaign, missing: int, fault: Fault, out: Outcome) -> None:
    """Samples lost between rig and topic: gaps in the published times against what was reported.

    A clock that is set, or a rig or driver that starts anew, begins another stream: what it could
    not date is reported as such, and its gaps are no loss of samples on the line."""
    if any(word in fault.name for word in ("set by", "restart", "without samples", "NaN")):
        return
    time = np.concatenate(lab.blocks)[:, 0] if lab.blocks else np.zeros(0)
    gaps = np.round(np.diff(time) * RATE).astype(int) - 1
    out.lost += int(gaps[gaps > 0].sum())
    out.reported += lab.end.missing - missing


def row(fault: Fault, out: Outcome) -> str:
    """Of the table."""
    states = ", ".join(f"{state} {out.states.count(state)}" for state in dict.fromkeys(out.states))
    rest = [value for value in out.rest if np.isfinite(value)]
    again = [value for value in out.again if np.isfinite(value) and value > 0]
    return (
        f"| {fault.name} | {fault.promise} | {states} | {out.beyond} | {out.lost} | "
        f"{out.reported} | {f'{1e3 * max(rest):.0f}' if rest else 'moves on'} | "
        f"{f'{np.median(again):.1f}' if again else '0'} |"
    )


HEAD = """# Reliability

What happens when something fails while a rig runs, and what an operator notices of it.

## Faults at random moments

Written by `make faults`: driver, line and emulated rig in virtual time, each fault {times} times at
a random moment of a running plate, {cases} cases in all, seed {seed}.

- "Promised" is what [safety.md](safety.md) says: *goes on*, *stops* (then ready: arm again),
  *faults* (then a reset is needed), or *any* of them where it depends on the moment.
- "Beyond a limit" counts cases in which the servo was told to pass a limit.
- A sample is lost where the published times have a gap; "reported" is the driver's own count. Where
  a clock is set or one end starts anew, another stream begins, and no gap is counted.
- The last column is the time that an operator needs who resets, arms and starts at once. Where the
  clocks were lost they are measured anew for a second.

{head}
"""
COLUMNS = (
    "fault",
    "promised",
    "state 1 s later",
    "beyond a limit",
    "samples lost",
    "reported",
    "slowest to rest [ms]",
    "running again [s], median",
)
TABLE_HEAD = f"| {' | '.join(COLUMNS)} |\n|{' --- |' * len(COLUMNS)}"


def main() -> int:
    """Run, print and write."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--times", type=int, default=10)
    options.add_argument("--only", default="")
    options.add_argument("--seed", type=int, default=1)
    given = options.parse_args()
    chosen = [fault for fault in FAULTS if given.only in fault.name]
    random = np.random.default_rng(given.seed)
    prepared = Campaign(lead=0.5).running(2.0)
    rows, broken = [], []
    for fault in chosen:
        out = Outcome()
        for _ in range(given.times):
            one_case(fault, prepared, random, out)
        if out.beyond or out.lost != out.reported or out.broken:
            broken.append(
                f"{fault.name}: {out.broken or 'motion beyond a limit or unreported loss'}"
            )
        rows.append(row(fault, out))
        print(rows[-1], flush=True)
    cases = len(chosen) * given.times
    verdict = f"{cases - len(broken)} of {cases}" if broken else f"all of {cases}"
    closing = f"\nSurvived without motion beyond a limit and without unreported loss: {verdict}.\n"
    if not given.only:
        old = PAGE.read_text() if PAGE.exists() else ""
        rest = old[old.index("\n## Live") :] if "\n## Live" in old else ""
        head = HEAD.format(times=given.times, cases=cases, seed=given.seed, head=TABLE_HEAD)
        PAGE.write_text(head + "\n".join(rows) + "\n" + closing + rest)
    print(closing + "\n".join(broken))
    return int(bool(broken))


if __name__ == "__main__":
    raise SystemExit(main())
