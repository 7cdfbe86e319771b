"""Removes each control of driver and rig in turn: a test of the default suite has to notice.

    make mutants                       all of them, in a copy of both packages
    python mutants.py WORDS...         those whose name has one of the words
    python mutants.py --jobs 2

Each mutant is one change of source and names the tests of which one has to fail then. The command
ends with 1 where a mutant survives.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[3]
DRIVER = "src/ankle_actuator_driver/ankle_actuator_driver/"
RIG = "src/rig_emulator/rig_emulator/"
TESTS = "src/ankle_actuator_driver/test/"
LONGEST = 120  # s of processor time for one mutant: a test that hangs has noticed, too
LONGEST_WAIT = 3600.0  # s for a machine that is busy with something else


class Mutant(NamedTuple):
    """One control, removed."""

    name: str
    file: str
    control: str
    without: str
    killer: str
    """A pytest expression, ``FILE:WORDS``."""


def _of(file: str, killer: str, *entries: tuple[str, str, str, str]) -> list[Mutant]:
    return [Mutant(name, file, a, b, f"{killer}:{words}") for name, a, b, words in entries]


MUTANTS = [
    *_of(
        DRIVER + "safety/limits.py",
        "test_motion.py",
        (
            "limit of the angle",
            "if stated[0] > self.angle * (1 + ROUNDING):",
            "if False:",
            "every_limit",
        ),
        (
            "limit of the velocity",
            "if stated[1] > self.velocity * (1 + ROUNDING):",
            "if False:",
            "every_limit",
        ),
        (
            "limit of the acceleration",
            "if stated[2] > self.acceleration * (1 + ROUNDING):",
            "if False:",
            "every_limit",
        ),
        ("room to stop", "if end > self.angle * (1 + ROUNDING):", "if False:", "leaves_room"),
        (
            "limit of the step",
            "if largest > self.step * (1 + ROUNDING):",
            "if False:",
            "every_limit or first_sample",
        ),
        (
            "velocity of the positions",
            "if largest > self.velocity * interval * (1 + STEP_MARGIN):",
            "if False:",
            "every_limit",
        ),
        (
            "acceleration of the positions",
            "if sharpest > self.acceleration * (1 + STEP_MARGIN):",
            "if False:",
            "zigzag",
        ),
        (
            "hard limits",
            "if getattr(self, field.name) > getattr(hard, field.name)",
            "if False",
            "hard_limit",
        ),
    ),
    *_of(
        DRIVER + "safety/limits.py",
        "test_barrier.py",
        (
            "angle between samples",
            "if position > self.angle * slack:",
            "if False:",
            "peaks_between",
        ),
        (
            "velocity between samples",
            "if velocity > self.velocity * slack:",
            "if False:",
            "peaks_between",
        ),
        (
            "acceleration between samples",
            "if path.largest_acceleration > self.acceleration * slack:",
            "if False:",
            "peaks_between",
        ),
        (
            "room to stop between samples",
            "if end > self.angle * slack:",
            "if False:",
            "between_two_samples",
        ),
    ),
    *_of(
        DRIVER + "safety/continuation.py",
        "test_barrier.py",
        (
            "velocity column against positions",
            "if abs(moved[worst] - said[worst]) > VELOCITY_MISMATCH * limits.velocity:",
            "if False:",
            "contradicts_another",
        ),
        (
            "acceleration column against velocities",
            "if abs(changed[worst] - stated[worst]) > ACCELERATION_MISMATCH * limits.acceleration:",
            "if False:",
            "contradicts_another",
        ),
        (
            "two sources by their times",
            "if float(time[0]) < self.end + HALF_A_SAMPLE * interval:",
            "if False:",
            "second_generator",
        ),
        (
            "a block that comes twice",
            "if float(time[-1]) < self.end + HALF_A_SAMPLE * interval:",
            "if False:",
            "comes_twice",
        ),
        (
            "path over the seam",
            "        if gap <= LONGEST_BRIDGE:\n            whole",
            "        if False:\n            whole",
            "turns_round or jump_after",
        ),
        ("rest before a pause", "if not self._rests(motion[0]):", "if False:", "jump_after"),
    ),
    *_of(
        DRIVER + "safety/reference_path.py",
        "test_barrier.py",
        (
            "start in the future",
            "kept = time > ros + RESUME_MARGIN",
            "kept = time > -1.0",
            "first_block",
        ),
        ("longest block", "if len(time) > LARGEST_BLOCK:", "if False:", "400000"),
        (
            "judging of the reference",
            "if decision.verdict is not Verdict.FOLLOWED:",
            "if False:",
            "not_even_kept",
        ),
    ),
    *_of(
        DRIVER + "safety/bridge.py",
        "test_barrier.py",
        (
            "a driver that hears nothing is silent",
            "elif now - self._listened > LOST_AFTER:",
            "elif False:",
            "no_longer_hears_sends",
        ),
        (
            "two publishers are not armed",
            'if name in ("arm", "start") and self._sources.several:',
            "if False:",
            "two_publishers",
        ),
        (
            "two publishers stop the plate",
            "if self._sources.several and self.states.state in (State.ARMED, State.RUNNING):",
            "if False:",
            "two_publishers",
        ),
        (
            "operator's dead-man's switch",
            "if self._operator is not None and now - self._operator > self.operator_timeout:",
            "if False:",
            "dead_mans",
        ),
        (
            "state packets without samples",
            "if self._samples_came.expired(now):",
            "if False:",
            "200_ms and no_samples",
        ),
        (
            "lower limits for what was sent before",
            "if len(ahead) and (passed := limits.stated_by(ahead)):",
            "if False and (passed := limits.stated_by(ahead)):",
            "lower_limits_stop",
        ),
        (
            "a start without a reference",
            "self.states.state is State.ARMED and self._sources.silent(now):",
            "False:",
            "waits_for_its_readers",
        ),
        (
            "a driver that takes no commands",
            "self._commands_heard is not None and now - self._commands_heard > COMMANDS_TIMEOUT:",
            "False:",
            "no_longer_takes_commands",
        ),
        (
            "path of the rig",
            "fault = self._path_check.fault(elsewhere, now) or",
            "fault =",
            "follow_the_r",
        ),
        (
            "measured angle",
            "if abs(position) > self.limits.angle + ANGLE_MARGIN:",
            "if False:",
            "measured_position_beyond",
        ),
        (
            "the driver's torque yield",
            "self._yield.measure(float(report.samples[:, 2].mean()))",
            "pass",
            "driver_yields",
        ),
    ),
    *_of(
        DRIVER + "safety/reference_path.py",
        "test_virtual_rig.py",
        (
            "soft start",
            "shaped = blend(motion, since, self._soft_start, self.held)",
            "shaped = motion",
            "first_packet_to or followed_at_its_own or without_a_reference",
        ),
    ),
    *_of(
        DRIVER + "safety/bridge.py",
        "test_virtual_rig.py",
        (
            "watchdog of the rig",
            "if self._report is not None and self._rig.expired(now):",
            "if False:",
            "falls_silent",
        ),
        ("watchdog of the reference", "if lost:", "if False:", "without_a_reference"),
        ("ROS time that is set", "if was_set:", "if False:", "ros_time_that_is_set"),
    ),
    *_of(
        DRIVER + "safety/states.py",
        "test_virtual_rig.py",
        ("start only when held", "if not self.confirmed:", "if False:", "first_packet_to"),
        (
            "arm only when ready",
            "if self.state is not State.READY:",
            "if False:",
            "first_packet_to",
        ),
        (
            "pressed emergency stop keeps the fault",
            "if report.status & Status.EMERGENCY_STOP_PRESSED:",
            "if False:",
            "emergency_stop",
        ),
        (
            "a fault of the rig is one of the driver",
            "elif report.fault is not DeviceFault.NONE and self.state is not State.FAULT:",
            "elif False:",
            "refused_by_the_rig_too or emergency",
        ),
    ),
    *_of(
        DRIVER + "safety/states.py",
        "test_barrier.py",
        (
            "no reset while the rig is silent",
            "if silent else None",
            "if False else None",
            "reset_while",
        ),
        (
            "off is believed only when answered",
            "report.state is DeviceState.OFF and (report.answered or not report.obeys)",
            "report.state is DeviceState.OFF",
            "not_confirmed_yet",
        ),
        (
            "no heartbeats for a rig that stays on",
            "            self.silent = True\n",
            "",
            "does_not_switch_off or powers_itself",
        ),
        (
            "confirmation in time",
            "elif self.confirmed or now - self._since > CONFIRMATION:",
            "elif False:",
            "never_confirms",
        ),
        (
            "a rig that obeys another driver",
            "        if not report.obeys:\n            self.trip",
            "        if False:\n            self.trip",
            "speaks_for_another",
        ),
        (
            "disarmed means off",
            "self._enter(State.STOPPING, now, reason)",
            "self._enter(State.READY, now, reason)",
            "after_disarming",
        ),
        (
            "a fault survives",
            "self.state = State.FAULT if fault else State.DISABLED",
            "self.state = State.DISABLED",
            "fault_survives",
        ),
    ),
    *_of(
        DRIVER + "safety/sensor_supervision.py",
        "test_barrier.py",
        ("encoder that does not follow", "or self._not_following(window)", "", "small_command"),
        (
            "velocity against position, and the plate's place",
            "            or self._away(whole, len(time), SERVO_LAG if interrupted else 0.0)\n"
            "            or self._velocity_contradicts(whole)\n",
            "",
            "200_ms and encoder_slip",
        ),
        (
            "velocity against position",
            "or self._velocity_contradicts(whole)",
            "",
            "200_ms and velocity_stuck",
        ),
        (
            "a part of a movement tells nothing of the torque",
            "interrupted = float(whole.time[0]) == self._resumed",
            "interrupted = False",
            "hangs_for_60_ms",
        ),
        (
            "dead torque sensor",
            "or self._torque_dead(whole, WINDOW if interrupted else 0.5 * WINDOW)",
            "",
            "200_ms and torque_dead",
        ),
        (
            "samples that are missing contradict no sensor",
            "whole = window.since_last_gap()",
            "whole = window",
            "hangs_for_60_ms",
        ),
    ),
    *_of(
        DRIVER + "safety/torque_check.py",
        "test_barrier.py",
        (
            "torque that stays",
            "elif at - self._beyond_since > TORQUE_PATIENCE:",
            "elif False:",
            "200_ms and saturated",
        ),
        (
            "torque that swings",
            "if again < LONGEST_SWING_TIME:",
            "if False:",
            "200_ms and torque_swings",
        ),
    ),
    *_of(
        DRIVER + "safety/stop_motion.py",
        "test_motion.py",
        (
            "a stop keeps the acceleration",
            "max(duration, 1.5 * speed / acceleration)",
            "duration",
            "no_room_left",
        ),
        (
            "a stop ends within the angle",
            "if 0.5 * speed * duration > room:",
            "if False:",
            "every_stop",
        ),
    ),
    *_of(
        DRIVER + "link/protocol/packet.py",
        "test_packet.py",
        (
            "digest",
            "return None if compare_digest(data[-DIGEST_SIZE:], expected) else Refusal.DIGEST",
            "return None",
            "key_is_understood or flipped",
        ),
        (
            "finite samples",
            "if not np.isfinite(samples).all():",
            "if False:",
            "every_refusal",
        ),
        ("length of a packet", "return Refusal.LENGTH", "return Refusal.KIND", "every_refusal"),
        (
            "sizes that cannot be",
            "(np.abs(samples) > LARGEST_SAMPLE).any()",
            "False",
            "every_refusal",
        ),
    ),
    *_of(
        DRIVER + "link/protocol/packet.py",
        "test_barrier.py",
        ("a greeting switches off", "or (not rig and wanted)", "", "whoever_begins"),
    ),
    *_of(
        DRIVER + "link/protocol/driver_end.py",
        "test_barrier.py",
        (
            "times that cannot be",
            "if not -1e9 * LARGEST_AGE < old < 1e9 * LARGEST_AGE:",
            "if False:",
            "cannot_be_of_its_time",
        ),
        (
            "a clock of the rig that leaps",
            "if abs(leap) > CLOCK_LEAP:",
            "if False:",
            "clock_of_the_rig_that_is_set",
        ),
    ),
    *_of(
        DRIVER + "link/protocol/driver_end.py",
        "test_virtual_rig.py",
        (
            "old packets of the rig",
            "return packet if newer(packet.sequence, last.sequence) else Refusal.OLD",
            "return packet",
            "lost_doubled",
        ),
    ),
    *_of(
        DRIVER + "link/protocol/heartbeats.py",
        "test_heartbeats.py",
        (
            "nobody speaks for a driver that hangs",
            "if now - self._alive > LOST_AFTER and parsed.wanted is not Wanted.OFF:",
            "if False:",
            "not_spoken_for",
        ),
        (
            "no heartbeats for a driver that hangs",
            "or now - self._alive > LOST_AFTER:",
            "or False:",
            "not_spoken_for",
        ),
    ),
    *_of(
        RIG + "emulated_device.py",
        "test_barrier.py",
        ("packets for another start of the rig", "return Refusal.START", "pass", "another_start"),
        (
            "sessions of former drivers",
            "or packet.session in self._retired",
            "",
            "former_session",
        ),
        (
            "the rig's torque fault",
            "            self._trip(DeviceFault.TORQUE, now)",
            "            pass",
            "torque_that_stays_without",
        ),
        (
            "following error",
            "if abs(samples[-1, 0] - self.command[0]) > LARGEST_FOLLOWING_ERROR:",
            "if False:",
            "far_from_its_command",
        ),
        (
            "off before on",
            "if self.state is DeviceState.OFF and host.asked_off:",
            "if self.state is DeviceState.OFF:",
            "whoever_begins",
        ),
    ),
    *_of(
        DRIVER + "ankle_actuator_driver_node.py",
        "test_commands.py",
        (
            "stop beside an arming that waits",
            "callback_group=commands",
            "callback_group=None",
            "arming_waits",
        ),
    ),
    *_of(
        DRIVER + "rig_session.py",
        "test_link.py",
        (
            "line cut where the driver hangs",
            "            self.link.silence()\n            self._line_was_cut = True\n",
            "            self._line_was_cut = True\n",
            "driver_hanging",
        ),
        (
            "line that only a reset opens",
            'if name == "reset_fault" and answer.done:',
            "if True:",
            "driver_hanging",
        ),
        (
            "fault of a line that was cut",
            "if self._line_was_cut:",
            "if False:",
            "driver_hanging",
        ),
    ),
    *_of(
        RIG + "emulated_device.py",
        "test_virtual_rig.py",
        (
            "the rig's heartbeat watchdog",
            "if self.state not in UNPOWERED and self._heartbeats.expired(now):",
            "if False:",
            "driver_that_dies or driver_dies",
        ),
        (
            "the rig's limits",
            "            self._trip(DeviceFault.REFERENCE_BEYOND_LIMIT, now)\n"
            "            return Refusal.LIMIT",
            "            pass",
            "refused_by_the_rig_too",
        ),
        (
            "the rig's torque yield",
            "self._yield.measure(torque if powered else 0.0)",
            "self._yield.measure(0.0)",
            "it_stays or takes_away",
        ),
        (
            "old packets of a driver",
            "if not newer(packet.sequence, host.sequence):",
            "if False:",
            "old_packets or lost_doubled",
        ),
        (
            "one driver at a time",
            "if self.state not in UNPOWERED or packet.session in self._retired:",
            "if packet.session in self._retired:",
            "two_drivers",
        ),
        (
            "emergency stop",
            "        self._trip(DeviceFault.EMERGENCY_STOP, now)",
            "        pass",
            "emergency",
        ),
    ),
]


def broken(mutant: Mutant, folder: Path) -> str:
    """The source without its control; raises where it is not found exactly once."""
    source = (folder / mutant.file).read_text()
    if source.count(mutant.control) != 1:
        raise ValueError(
            f"'{mutant.name}': {source.count(mutant.control)} places in {mutant.file} are\n"
            f"{mutant.control}"
        )
    return source.replace(mutant.control, mutant.without)


def _limit_processor_time() -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (LONGEST, LONGEST + 5))


def run(mutant: Mutant) -> tuple[Mutant, str]:
    """Return what became of a mutant: killed, killed because a test hangs, or survived."""
    with tempfile.TemporaryDirectory(prefix="mutant_") as name:
        copy = Path(name)
        for package in ("ankle_actuator_driver", "rig_emulator"):
            shutil.copytree(ROOT / "src" / package, copy / "src" / package)
        shutil.copytree(ROOT / "docs", copy / "docs")
        (copy / mutant.file).write_text(broken(mutant, copy))
        file, _, words = mutant.killer.partition(":")
        paths = [
            str(copy / "src" / package) for package in ("ankle_actuator_driver", "rig_emulator")
        ]
        command = [sys.executable, "-m", "pytest", "-q", "-x", "-n", "0", "-p", "no:cacheprovider"]
        command += [
            "--import-mode=importlib",
            "-m",
            "not slow",
            "-k",
            words,
            str(copy / TESTS / file),
        ]
        command += ["-c", str(ROOT / "pyproject.toml"), "--rootdir", str(copy)]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
        try:
            found = subprocess.run(
                command,
                cwd=copy,
                env=environment,
                capture_output=True,
                text=True,
                timeout=LONGEST_WAIT,
                check=False,
                preexec_fn=_limit_processor_time,
            )
        except subprocess.TimeoutExpired:
            return mutant, f"ERROR: not decided within {LONGEST_WAIT:g} s"
    if found.returncode == -signal.SIGXCPU:
        return mutant, "killed (hangs)"
    if found.returncode == 1:
        return mutant, "killed"
    return mutant, "SURVIVED" if found.returncode == 0 else f"ERROR: {found.stdout[-300:]}"


def main() -> int:
    """Run and print a table."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("words", nargs="*")
    options.add_argument("--jobs", type=int, default=2)
    given = options.parse_args()
    chosen = [m for m in MUTANTS if not given.words or any(w in m.name for w in given.words)]
    alive = 0
    print("| control removed | in | test | |\n| --- | --- | --- | --- |")
    with ThreadPoolExecutor(given.jobs) as pool:
        for mutant, fate in pool.map(run, chosen):
            alive += not fate.startswith("killed")
            file = mutant.file.rpartition("/")[2]
            print(f"| {mutant.name} | {file} | {mutant.killer} | {fate} |", flush=True)
    print(f"\n{len(chosen) - alive} of {len(chosen)} mutants killed")
    return int(alive > 0)


if __name__ == "__main__":
    raise SystemExit(main())
