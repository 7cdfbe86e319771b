"""Faults at random moments of a running rig, in virtual time: what was promised, what happened.

    make faults                      all faults, 10 times each; writes docs/reliability.md
    python fault_campaign.py --times 2 --only torque

For each fault: motion that the servo was commanded beyond a limit, samples lost as counted from end
to end and as reported by the driver, time from the fault to the plate at rest, and time from the
end of the fault to a running plate. The command ends with 1 where a promise was broken.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from campaign_acts import Fault
from campaign_laboratory import Campaign, at_each_moment, at_moment
from fault_table import HEAD as TABLE_HEAD
from fault_table import Case, Outcome, verdict, write_section
from faults_of_ends import COMMANDS_OF_THE_OPERATOR, DRIVER, GENERATOR, RIG
from faults_of_signals import CLOCKS, FAULT_PAIRS, SENSORS, STATES_OF_THE_LINE
from virtual_laboratory import RATE

from ankle_actuator_driver.safety.rig import UNPOWERED

PAGE = Path(__file__).resolve().parents[3] / "docs" / "reliability.md"
LIMITS = np.array([0.175, 5.0, 2000.0]) * (1 + 1e-5)  # rad, rad/s, rad/s^2
PATIENCE = 6.0  # s; to be running again
LONGEST_REST = 0.35  # s; both watchdogs, or a sensor's 200 ms, and a stop
OFF = ("ready", "fault", "disabled")
FAULTS = (
    *DRIVER,
    *COMMANDS_OF_THE_OPERATOR,
    *GENERATOR,
    *RIG,
    *STATES_OF_THE_LINE,
    *CLOCKS,
    *SENSORS,
    *FAULT_PAIRS,
)


def recover(lab: Campaign) -> float:
    """Return the time [s] to a running plate: the operator resets, arms and starts at once."""
    began = lab.now
    commands = {"fault": "reset_fault", "ready": "arm", "armed": "start"}
    while lab.state != "running" and lab.now - began < PATIENCE:
        if lab.state in commands:
            lab.command(commands[lab.state])
        lab.run(0.01)
    return lab.now - began if lab.state == "running" else np.nan


def one_case(fault: Fault, prepared: dict[str, Campaign], random: np.random.Generator) -> Case:
    """Let one fault happen at a random moment."""
    lab = at_moment(fault.moment, prepared, random)
    missing, began = lab.end.missing, lab.now
    fault.begin(lab)
    lab.run(fault.lasts)
    fault.end(lab)
    lab.run(0.4)
    case = Case(lab.state, lab.bridge.states.reason)
    if case.state != "running":
        case.rest = max(lab.moved - began, 0.0)
        case.problems += unsafe(lab, fault, case)
        case.again = recover(lab)
    lab.run(0.3)
    commands = lab.commands()
    jumps = np.abs(np.diff(commands[:, 1])).max() > 1.03 * LIMITS[1] / RATE
    case.beyond = bool((np.abs(commands[:, 1:]).max(axis=0) > LIMITS).any() or jumps)
    if not fault.new_stream:
        case.lost, case.reported = lost_samples(lab), lab.end.missing - missing
    return case


def unsafe(lab: Campaign, fault: Fault, case: Case) -> list[str]:
    """Return what is dangerous about a rig that does not run any more, as sentences."""
    found = []
    if case.state in OFF and lab.powered:
        found.append(f"the driver is {case.state}, but the rig is {lab.device.state.name.lower()}")
    if fault.moment in OFF and case.state in OFF and (lab.seen - set(UNPOWERED)):
        found.append("the drive got power unasked")
    if case.rest > LONGEST_REST + fault.notice:
        found.append(f"the plate was at rest after {case.rest:.2f} s only")
    return found


def lost_samples(lab: Campaign) -> int:
    """Return how many samples were lost between rig and topic: the gaps in the published times."""
    time = np.concatenate(lab.blocks)[:, 0] if lab.blocks else np.zeros(0)
    gaps = np.round(np.diff(time) * RATE).astype(int) - 1
    return int(gaps[gaps > 0].sum())


TITLE = "Faults at random moments"
HEAD = """Written by `make faults`: driver, line and emulated rig in virtual time, each fault
{times} times at a random moment, {cases} cases in all, seed {seed}. The plate runs where no other
state is named.

- "Promised" is what [safety.md](safety.md) says: *goes on*; *stops* (then ready: arm again);
  *faults* (then a reset is needed); *ends off* (without power, in whichever of these states);
  *stays* in the state that is named; or *any* of them where it depends on the moment. In each
  case the drive has no power where the driver says so, gets none unasked, and the plate is at rest
  0.35 s after the fault could be noticed.
- "Beyond a limit" counts cases in which the servo was commanded to pass a limit.
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
    prepared = at_each_moment()
    outcomes = []
    for fault in chosen:
        outcome = Outcome(fault.name, fault.promise)
        outcome.cases += [one_case(fault, prepared, random) for _ in range(given.times)]
        outcomes.append(outcome)
        print(outcome.row(), flush=True)
    cases = len(chosen) * given.times
    if not given.only:
        head = HEAD.format(times=given.times, cases=cases, seed=given.seed, head=TABLE_HEAD)
        rows = "\n".join(outcome.row() for outcome in outcomes)
        write_section(PAGE, TITLE, f"{head}{rows}\n\n{verdict(outcomes)}\n")
    broken = [sentence for outcome in outcomes for sentence in outcome.broken()]
    print(verdict(outcomes), *broken, sep="\n")
    return int(bool(broken))


if __name__ == "__main__":
    raise SystemExit(main())
