"""Publishes the perturbation that the actuator follows.

| topic | direction | content |
| --- | --- | --- |
| perturbation/reference | out, 64 Hz | t[s],position[rad],velocity[rad/s],acceleration[rad/s^2] |
| ~/perturb | service | Trigger: what a signal gives on request; answers its onset [s] |
| ~/rest | service | Trigger: ends what was requested; answers how long it lasts still [s] |
| /diagnostics | out, 1 Hz | blocks sent, late blocks, worst lateness |

Sample k has the time t0 + k / rate, t0 being the ROS time of the start (``wait_for_readers``). A
block leaves when the time of its last sample is reached, less the parameter ``lead``. A block that
is late is sent all the same, with its own times.
Parameters: `perturbation_generator.parameters`.
"""

from __future__ import annotations

import threading
import time

import numpy as np
from rclpy.duration import Duration
from std_srvs.srv import Trigger

from ankle_interfaces.quantity import Value
from ankle_interfaces.topics import PERTURBATION_REFERENCE
from ankle_node.interruptible_sleep import InterruptibleSleep
from ankle_node.node import OK, WARN, AnkleNode, run
from ankle_node.real_time import GENERATOR_PRIORITY, keep_loaded_objects, take_priority
from perturbation_generator.limits import limits_from
from perturbation_generator.on_request import OnRequest
from perturbation_generator.pacing import Lateness, Schedule
from perturbation_generator.parameters import BLOCK_SIZE, LEAD, PARAMETERS, READERS
from perturbation_generator.signals import signal_from

# Between blocks that are sent late, so that a long backlog does not overrun the readers' queues of
# 64 blocks.
CATCH_UP_PAUSE = 0.5e-3  # s
# Until simulated time starts.
CLOCK_POLL = 0.02  # s
# For the readers to confirm the last blocks before the process ends.
LAST_BLOCKS_TIMEOUT = 2.0  # s


class PerturbationGeneratorNode(AnkleNode):
    """Paces a signal by absolute deadlines in a thread of its own."""

    def __init__(self) -> None:
        super().__init__("perturbation_generator", PARAMETERS)
        values = {parameter.name: self.value(parameter.name) for parameter in PARAMETERS}
        self._limits = limits_from(values)
        self._signal = signal_from(values)
        self._limits.check(self._signal, self._signal.amplitude)
        self._block_size = int(values[BLOCK_SIZE.name])
        self._lead = float(values[LEAD.name])
        # One block behind: the next one is due already.
        self._lateness = Lateness(self._block_size / self._signal.settings.rate)
        self._publish = self.block_publisher(PERTURBATION_REFERENCE)
        keep_loaded_objects()
        if self._lead > 0.0 and (refusal := take_priority(GENERATOR_PRIORITY)):
            self.get_logger().warning(refusal)
        self._busy = threading.Lock()
        self._schedule: Schedule | None = None
        self.create_service(Trigger, "~/perturb", self._perturb)
        self.create_service(Trigger, "~/rest", self._rest)
        self._stopped = threading.Event()
        self._sleep = InterruptibleSleep(self)
        self.health("clock", OK, "")
        self.health("pacing", OK, "")
        self._report()
        self._failure: Exception | None = None
        self._failed = self.create_guard_condition(self._raise_failure)
        self._thread = threading.Thread(target=self._guarded_pace, name="pacing", daemon=True)
        self.when_read(PERTURBATION_REFERENCE, int(values[READERS.name]), self._thread.start)

    def parameters_changed(self, values: dict[str, Value]) -> None:
        """Apply a new amplitude, the only parameter that may change, from the next movement on."""
        if "amplitude" in values:
            amplitude = float(values["amplitude"])
            self._limits.check(self._signal, amplitude)
            with self._busy:
                self._signal.set_amplitude(amplitude)

    def _perturb(self, request: Trigger.Request, answer: Trigger.Response) -> Trigger.Response:
        """Give a stretch or the movements of a calibration, if the signal waits for that."""
        answer.success = False
        if not self._signal.awaits_requests:
            answer.message = self._runs_by_itself()
        elif self._schedule is None:
            answer.message = "the signal has not started: it waits for its readers"
        else:
            with self._busy:
                busy_for, onset = self._signal.busy_for, self._signal.request()
            answer.success = onset is not None
            answer.message = (
                f"{self._schedule.start + onset:.6f}"
                if onset is not None
                else f"the last movement is not over for another {busy_for:.1f} s"
                if busy_for
                else "the amplitude is 0, or the signal ends"
            )
        return answer

    def _runs_by_itself(self) -> str:
        return (
            f"signal '{self._signal.name}' runs by itself; single stretches need the parameter "
            f"signal = {OnRequest.name}, the calibration of a rig rig_calibration.on_request = true"
        )

    def _rest(self, request: Trigger.Request, answer: Trigger.Response) -> Trigger.Response:
        """Let what was requested end before its time, if the signal waits for requests."""
        answer.success = self._signal.awaits_requests
        if not answer.success:
            answer.message = self._runs_by_itself()
            return answer
        with self._busy:
            self._signal.rest()
            answer.message = f"{self._signal.busy_for:.6f}"
        return answer

    def destroy_node(self) -> None:
        """Stop the pacing first, so that no block leaves a node that ends."""
        self._stopped.set()
        self._sleep.interrupt()
        if self._thread.is_alive():
            self._thread.join(timeout=2 * LAST_BLOCKS_TIMEOUT)
        super().destroy_node()

    @property
    def _running(self) -> bool:
        return not self._stopped.is_set() and self.context.ok()

    def _guarded_pace(self) -> None:
        try:
            self._pace()
        except Exception as error:
            if self._running:  # else the node was taken down meanwhile
                self._failure = error
                self._failed.trigger()

    def _raise_failure(self) -> None:
        """Raise the pacing thread's error in the executor, so that it ends the process."""
        if self._failure is not None:
            raise self._failure

    def _pace(self) -> None:
        while self._running and not self.now() > 0:
            self.health("clock", WARN, "simulated time has not started: waiting for /clock")
            time.sleep(CLOCK_POLL)
        self.health("clock", OK, "")
        settings = self._signal.settings
        schedule = self._schedule = Schedule(self.now(), settings.rate, self._lead)
        first = 0
        while self._running and first != settings.samples:
            n = (
                self._block_size
                if settings.samples is None
                else min(self._block_size, settings.samples - first)
            )
            with self._busy:
                samples = self._signal.next(n)
                self._signal.forget_onsets()
            block = np.column_stack([schedule.times(first, n), samples])
            deadline = schedule.deadline(first, n)
            if self.now() < deadline:
                self._sleep.until(deadline)
            else:
                time.sleep(CATCH_UP_PAUSE)
            if not self._running:
                return
            self._publish(block)
            self._note(self.now() - deadline)
            first += n
        if self._running:
            self._finish()

    def _note(self, delay: float) -> None:
        if self._lateness.note(delay):
            self.health(
                "pacing",
                WARN,
                f"a block left {1e3 * delay:.1f} ms late; {self._lateness.late} late so far, none "
                "left out",
            )
        self._report()

    def _report(self) -> None:
        self.count("blocks sent", self._lateness.sent)
        self.count("late blocks", self._lateness.late)
        self.count("worst lateness [ms]", f"{1e3 * self._lateness.worst:.2f}")

    def _finish(self) -> None:
        self.get_logger().info(
            f"the signal is over: {self._lateness.sent} blocks sent, {self._lateness.late} of "
            "them late"
        )
        for publisher in self.publishers:
            if publisher.topic_name == self.resolve_topic_name(PERTURBATION_REFERENCE.name):
                publisher.wait_for_all_acked(Duration(seconds=LAST_BLOCKS_TIMEOUT))
        self.context.try_shutdown()


def main() -> int:
    """Start the node: the entry point of ``ros2 run perturbation_generator
    perturbation_generator``.
    """
    return run(PerturbationGeneratorNode)


if __name__ == "__main__":
    raise SystemExit(main())
