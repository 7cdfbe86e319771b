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
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from fault_table import HEAD as TABLE_HEAD
from fault_table import Case, Outcome, verdict
from virtual_laboratory import BLOCK, EPOCH, RATE, VirtualLaboratory

from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings
from rig_emulator.faults import Faults

PAGE = Path(__file__).resolve().parents[3] / "docs" / "reliability.md"
LIMITS = np.array([0.175, 5.0, 2000.0]) * (1 + 1e-5)  # rad, rad/s, rad/s^2
LASTS = 0.6  # s; of a fault that ends by itself
PATIENCE = 6.0  # s; to be running again
REST = 1e-3  # rad/s
ANOTHER_STREAM = ("set by", "restart")
"""Words in the names of faults after which another stream of samples begins: what lies between the
two streams is no gap in one of them, and the driver reports it as an interruption."""
Laboratory = VirtualLaboratory


@dataclass(frozen=True)
class Fault:
    """A fault and what is promised for it.

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
    """Return what switches on faults of line, sensors and controller."""
    return lambda lab: lab.faults(**switches)


def line(up: float = 1.0, down: float = 1.0, **switches: float) -> Callable[[Laboratory], None]:
    """Return what switches on faults of the line, weighted for each way."""

    def begin(lab: Laboratory) -> None:
        lab.up.faults = Faults(**{name: up * value for name, value in switches.items()})
        lab.down.faults = Faults(**{name: down * value for name, value in switches.items()})

    return begin


def attribute(name: str, value: object, after: object) -> tuple[Callable, Callable]:
    """Return what sets an attribute of the laboratory, and what sets it back."""
    return (lambda lab: setattr(lab, name, value)), (lambda lab: setattr(lab, name, after))


def new_driver(lab: Laboratory) -> None:
    """Kill the driver and start it again."""
    lab.new_driver(lab.bridge_number + 1)
    lab.bridge_number += 1


def new_rig(lab: Laboratory) -> None:
    """Restart the rig's controller."""
    old = lab.device
    lab.device = type(old)(lab.plant, lab.limits, RATE, old._session + 1, lab.rig_time)
    lab.device.command = (old.command[0], 0.0, 0.0)
    lab.device.commands, lab.device.velocities = old.commands, old.velocities


def new_generator(lab: Laboratory) -> None:
    """Let the perturbation begin from its start."""
    lab.signal = PulseStep(Settings(rate=RATE, seed=4))


def ros_time(seconds: float) -> Callable[[Laboratory], None]:
    """Return what sets ROS time."""

    def begin(lab: Laboratory) -> None:
        lab.epoch += seconds
        lab.reference_shift += seconds

    return begin


def rig_clock(seconds: float) -> Callable[[Laboratory], None]:
    """Return what sets the rig's clock."""

    def begin(lab: Laboratory) -> None:
        lab.offset += seconds
        lab.device._begin += seconds

    return begin


def blocks(kind: str) -> Callable[[Laboratory], None]:
    """Return what loses, doubles or reorders blocks of the reference on their way to the driver."""
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


def recover(lab: Campaign) -> float:
    """Return the time [s] to a running plate: the operator resets, arms and starts at once."""
    began = lab.now
    commands = {"fault": "reset_fault", "ready": "arm", "armed": "start"}
    while lab.state != "running" and lab.now - began < PATIENCE:
        if lab.state in commands:
            lab.command(commands[lab.state])
        lab.run(0.01)
    return lab.now - began if lab.state == "running" else np.nan


def one_case(fault: Fault, prepared: Campaign, random: np.random.Generator) -> Case:
    """Let one fault happen at a random moment."""
    lab = copy.deepcopy(prepared)
    lab.device.commands, lab.device.velocities, lab.blocks = lab.device.commands[-1:], [], []
    lab.run(float(random.uniform(0.0, 0.6)))
    lab.until_moving(0.2)
    missing, at, offset = lab.end.missing, lab.rig_time, lab.offset
    fault.begin(lab)
    if "and a stop" in fault.name:
        lab.command("stop")
    lab.run(LASTS)
    fault.end(lab)
    lab.run(0.4)
    case = Case(lab.state, lab.bridge.states.reason)
    if case.state != "running":
        was_set = lab.offset - offset  # of the rig's clock, by the fault itself [s]
        case.rest = float(lab.moves_until(at).max()) - was_set
        case.again = recover(lab)
    lab.run(0.3)
    commands = lab.commands()
    jumps = np.abs(np.diff(commands[:, 1])).max() > 1.03 * LIMITS[1] / RATE
    case.beyond = bool((np.abs(commands[:, 1:]).max(axis=0) > LIMITS).any() or jumps)
    if not any(word in fault.name for word in ANOTHER_STREAM):
        case.lost, case.reported = lost_samples(lab), lab.end.missing - missing
    return case


def lost_samples(lab: Campaign) -> int:
    """Return how many samples were lost between rig and topic: the gaps in the published times."""
    time = np.concatenate(lab.blocks)[:, 0] if lab.blocks else np.zeros(0)
    gaps = np.round(np.diff(time) * RATE).astype(int) - 1
    return int(gaps[gaps > 0].sum())


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


def main() -> int:
    """Run the faults, print the table and write it into the page."""
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
    outcomes = []
    for fault in chosen:
        outcome = Outcome(fault.name, fault.promise)
        outcome.cases += [one_case(fault, prepared, random) for _ in range(given.times)]
        outcomes.append(outcome)
        print(outcome.row(), flush=True)
    cases = len(chosen) * given.times
    closing = f"\n{verdict(outcomes)}\n"
    if not given.only:
        old = PAGE.read_text() if PAGE.exists() else ""
        rest = old[old.index("\n## Live") :] if "\n## Live" in old else ""
        head = HEAD.format(times=given.times, cases=cases, seed=given.seed, head=TABLE_HEAD)
        rows = "\n".join(outcome.row() for outcome in outcomes)
        PAGE.write_text(f"{head}{rows}\n{closing}{rest}")
    broken = [sentence for outcome in outcomes for sentence in outcome.broken()]
    print(closing + "\n".join(broken))
    return int(bool(broken))


if __name__ == "__main__":
    raise SystemExit(main())
