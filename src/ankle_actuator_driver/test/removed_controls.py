"""Every control of driver and rig whose removal a test of the default suite has to notice."""

from __future__ import annotations

from typing import NamedTuple

DRIVER = "src/ankle_actuator_driver/ankle_actuator_driver/"
RIG = "src/rig_emulator/rig_emulator/"


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
        "test_line.py",
        (
            "a driver that hears nothing is silent",
            "elif now - self._listened > LOST_AFTER:",
            "elif False:",
            "no_longer_hears_sends",
        ),
    ),
    *_of(
        DRIVER + "safety/watchdog.py",
        "test_line.py",
        (
            "a pause excuses silence for a while only",
            "(now > self._excused_until or silence > LONGEST_SILENCE)",
            "now > self._excused_until",
            "put_aside_again_and_again",
        ),
    ),
    *_of(
        DRIVER + "safety/bridge.py",
        "test_barrier.py",
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
    ),
    *_of(
        DRIVER + "safety/bridge.py",
        "test_plate_supervision.py",
        (
            "state packets without samples",
            "if self._samples_came.expired(now):",
            "if False:",
            "200_ms and no_samples",
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
        DRIVER + "safety/states.py",
        "test_plate_supervision.py",
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
    ),
    *_of(
        DRIVER + "safety/states.py",
        "test_line.py",
        (
            "a rig that obeys another driver",
            "        if not report.obeys:\n            self.trip",
            "        if False:\n            self.trip",
            "speaks_for_another",
        ),
        (
            "a rig that was lost is not ready",
            "if self.state is State.READY and not report.obeys:",
            "if False:",
            "not_ready_and_leaves",
        ),
    ),
    *_of(
        DRIVER + "safety/sensor_supervision.py",
        "test_plate_supervision.py",
        ("encoder that does not follow", "or self._not_following(window)", "", "small_command"),
        (
            "velocity against position, and the plate's place",
            (
                "            or self._away(whole, len(time), SERVO_LAG if interrupted else 0.0)\n"
                "            or self._velocity_contradicts(whole)\n"
            ),
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
        "test_plate_supervision.py",
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
        ("finite samples", "if not np.isfinite(samples).all():", "if False:", "every_refusal"),
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
        "test_line.py",
        ("a greeting switches off", "or (not rig and wanted)", "", "whoever_begins"),
    ),
    *_of(
        DRIVER + "link/protocol/driver_end.py",
        "test_line.py",
        (
            "times that cannot be",
            "if not (age < LARGEST_AGE and lead < LARGEST_LEAD):",
            "if False:",
            "cannot_be_of_its_time",
        ),
        (
            "a clock of the rig that leaps",
            "if abs(leap) > CLOCK_LEAP:",
            "if False:",
            "clock_of_the_rig_that_is_set",
        ),
        (
            "samples that are not measured yet",
            "return Refusal.TIME\n        ahead",
            "pass\n        ahead",
            "lie_in_the_future",
        ),
        (
            "a rig is left to a driver that speaks",
            "silent = now - self._other_driver_heard > OTHER_DRIVER_SILENCE",
            "silent = True",
            "leaves_it_to_the_other",
        ),
        (
            "a powered rig is left alone",
            "gone = silent and packet.state in UNPOWERED and",
            "gone = silent and",
            "under_power",
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
        "test_line.py",
        ("packets for another start of the rig", "return Refusal.START", "pass", "another_start"),
        ("sessions of former drivers", "or packet.session in self._retired", "", "former_session"),
        (
            "off before on",
            "if self.state is DeviceState.OFF and host.asked_off:",
            "if self.state is DeviceState.OFF:",
            "whoever_begins",
        ),
    ),
    *_of(
        RIG + "emulated_device.py",
        "test_plate_supervision.py",
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
            ("            self.link.silence()\n            self._line_was_cut = True\n"),
            "            self._line_was_cut = True\n",
            "driver_hanging",
        ),
        (
            "line that only a reset opens",
            'if name == "reset_fault" and answer.done:',
            "if True:",
            "driver_hanging",
        ),
        ("fault of a line that was cut", "if self._line_was_cut:", "if False:", "driver_hanging"),
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
            (
                "            self._trip(DeviceFault.REFERENCE_BEYOND_LIMIT, now)\n"
                "            return Refusal.LIMIT"
            ),
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
