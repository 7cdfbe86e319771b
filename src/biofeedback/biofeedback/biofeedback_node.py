"""The subject's screen and the operator's page.

| topic | direction | type | what |
| --- | --- | --- | --- |
| /impedance/estimate | in | Float64MultiArray | t[s],K[N.m/rad],G[N.m.s/rad],valid[1]: the cursor |
| /ankle/samples | in | Float64MultiArray | t[s],position[rad],velocity[rad/s],torque[N.m]: the subject's torque, traces |
| /emg/samples | in | Float64MultiArray | t[s],SOL[V],TA[V],GL[V],GM[V]: traces |
| /diagnostics | in, out | DiagnosticArray | health, recording, free disk; own frames and pages |
| /rig/state | in | String | state of the rig's driver |
| /session/event | out | String | holds, targets, start, pause, stop, faults, notes (`ankle_node.session_event`) |

Services that it calls: `arm`, `start`, `stop`, `reset_fault` of the rig's driver
(std_srvs/Trigger), parameters of `ankle_sim`.
Pages: `biofeedback.web.server`. The graph's messages are taken by the executor's thread; pages,
commands and the session belong to the server's thread, and `LiveSignals` is what both touch.
Parameters: `biofeedback.parameters`.
"""  # noqa: E501

from __future__ import annotations

import asyncio
import threading
import time
from pathlib import Path

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from std_msgs.msg import String

from ankle_interfaces.block import Block
from ankle_interfaces.continuity import Finding
from ankle_node.node import WARN, AnkleNode, run
from ankle_node.session_event import TOPIC as EVENT_TOPIC
from ankle_node.session_event import SessionEvent
from biofeedback import parameters as declared
from biofeedback.errors import CommandError
from biofeedback.live_signals import LiveSignals
from biofeedback.session import saved_session
from biofeedback.session.protocol import load_protocol
from biofeedback.session.rig_services import RigServices
from biofeedback.session.session_program import Session
from biofeedback.session.simulated_subject import SimulatedPerson
from biofeedback.web.access import Access, is_loopback
from biofeedback.web.presenter import Desk
from biofeedback.web.server import Server
from emg_driver.muscles import MUSCLES, SAMPLE_COLUMNS, SAMPLES_TOPIC
from impedance_estimator.estimator import ESTIMATE_TOPIC

SAMPLES = "/ankle/samples"
ESTIMATE = ("K[N.m/rad]", "G[N.m.s/rad]", "valid[1]")
LOOK_PERIOD = 1.0  # s; how soon a rig or a simulated subject that starts later is seen
SAVE_PERIOD = 1.0  # s; what a crash may cost of a step's clock
START_PATIENCE = 10.0  # s
# A recorder hears a node that was started anew only once the two have found each other: events wait
# for it, with the times they have.
DISCOVERY, LONGEST_DISCOVERY = 2.0, 10.0  # s; with a reader, without one
EVENTS_KEPT = 100  # for a recorder that is slow to read; a session has a few hundred events in all


class BiofeedbackNode(AnkleNode):
    """Wires topics to signals and the desk to its pages."""

    def __init__(self) -> None:
        super().__init__("biofeedback", declared.PARAMETERS)
        host, token = self.text("host"), self.text("token")
        access = Access(host, token)
        session = Session(load_protocol(self.text("protocol")))
        self._signals = LiveSignals(self.number("torque_cutoff"), MUSCLES)
        self._rig, self._person = RigServices(self, self.text("rig")), SimulatedPerson(self)
        self._events = self.create_publisher(String, EVENT_TOPIC, EVENTS_KEPT)
        self._desk = Desk(
            session,
            self._signals,
            self._rig,
            self._person,
            self._publish,
            self.number("cursor_frequency"),
        )
        self._server = Server(
            self._desk, self._signals, access, self.now, self.number("frame_rate"), self._beat
        )
        self._began, self._unsent = time.monotonic(), list[SessionEvent]()
        self._failure: Exception | None = None
        self._failed = self.create_guard_condition(self._raise_failure)
        self._loop, self._stopped = asyncio.new_event_loop(), asyncio.Event()
        self._serving = threading.Event()
        self._state_file = Path()
        self._saved, self._saved_at = session.saved(), time.monotonic()
        self._thread = threading.Thread(
            target=self._serve, args=(host, int(self.number("port"))), name="pages", daemon=True
        )
        self.create_timer(LOOK_PERIOD, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._look()
        self._ankle = self.block_subscription(SAMPLES, (), self._take_samples)
        self.block_subscription(ESTIMATE_TOPIC, ESTIMATE, self._take_estimates)
        self.block_subscription(SAMPLES_TOPIC, SAMPLE_COLUMNS[1:], self._take_emg)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._take_diagnostics, 50)
        self._thread.start()
        if not self._serving.wait(START_PATIENCE) or self._failure is not None:
            raise self._failure or OSError(f"the pages were not there within {START_PATIENCE:g} s")

    def _serve(self, host: str, port: int) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._server.run(host, port, self._ready, self._stopped))
        except Exception as error:
            self._failure = error
            self._serving.set()
            self._failed.trigger()

    def _raise_failure(self) -> None:
        """In the executor, so that an error of the pages' thread ends the process."""
        if self._failure is not None:
            raise self._failure

    def _ready(self, port: int) -> None:
        self._state_file = (
            Path(self.text("state_file"))
            if self.text("state_file")
            else saved_session.default_path(port)
        )
        self._resume()
        host, token = self.text("host"), self.text("token")
        shown = host if is_loopback(host) else f"{host} (or this computer's name)"
        query = f"?token={token}" if token else ""
        self.get_logger().info(
            f"subject's screen: http://{shown}:{port}/{query}   operator's page: "
            f"http://{shown}:{port}/operator{query}"
        )
        self._serving.set()

    def _resume(self) -> None:
        try:
            found = saved_session.load(self._state_file, time.time(), self.number("resume_within"))
            if found is not None and (
                found.get("state") not in ("idle", "finished") or found.get("index")
            ):
                self._desk.happened(self._desk.session.resume(found, self.now()))
                self.get_logger().info(
                    f"going on with the session in {self._state_file}: {found['state']}, step "
                    f"{found['index'] + 1}"
                )
        except CommandError as error:
            self.get_logger().warning(str(error))
            self.health("saved session", WARN, str(error))

    def _beat(self) -> None:
        """Send what waits, and keep progress on disk: at each step, and once a second while the
        clock runs.
        """
        if self._unsent:
            self._send_events()
        present = self._desk.session.saved()
        timeless = {"elapsed": 0.0, "clock": 0.0}
        stepped = {**present, **timeless} != {**self._saved, **timeless}
        if not stepped and (
            present == self._saved or time.monotonic() - self._saved_at < SAVE_PERIOD
        ):
            return
        self._saved, self._saved_at = present, time.monotonic()
        try:
            saved_session.save(self._state_file, present, time.time())
        except OSError as error:
            self.health("saved session", WARN, f"progress is not kept: {error}")

    def _publish(self, event: SessionEvent) -> None:
        self.get_logger().info(event.line())
        self._unsent.append(event)
        self._send_events()

    def _send_events(self) -> None:
        """What is unsent, as soon as the readers are there."""
        running = time.monotonic() - self._began
        if running > LONGEST_DISCOVERY or (
            running > DISCOVERY and self._events.get_subscription_count()
        ):
            for event in self._unsent:
                self._events.publish(String(data=event.line()))
            self._unsent.clear()

    def _look(self) -> None:
        self._rig.look()
        self._person.look()
        self.count("frames made late", self._server.late_frames)
        self.count("pages closed for what they sent", self._server.closed_for_cause)

    def _take_samples(self, block: Block, findings: list[Finding]) -> None:
        in_si, _ = block.in_si()
        if not (
            len(block.data)
            and self._ankle.rate
            and in_si.has("position[rad]")
            and in_si.has("torque[N.m]")
        ):
            return
        velocity = (
            in_si.column("velocity[rad/s]")
            if in_si.has("velocity[rad/s]")
            else np.zeros(len(block.data))
        )
        columns = (in_si.time, in_si.column("position[rad]"), velocity, in_si.column("torque[N.m]"))
        self._signals.feed_samples(np.column_stack(columns), self._ankle.rate, time.monotonic())

    def _take_estimates(self, block: Block, findings: list[Finding]) -> None:
        self._signals.feed_estimates(block.data, time.monotonic())

    def _take_emg(self, block: Block, findings: list[Finding]) -> None:
        self._signals.feed_emg(block.data)

    def _take_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            figures = {value.key: value.value for value in status.values}
            self._signals.feed_status(
                status.name, status.level[0], status.message, figures, time.monotonic()
            )

    def destroy_node(self) -> None:
        """Closes the pages first."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._stopped.set)
            self._thread.join(timeout=5.0)
        super().destroy_node()


def main() -> int:
    """Entry point of ``ros2 run biofeedback biofeedback``."""
    return run(BiofeedbackNode)
