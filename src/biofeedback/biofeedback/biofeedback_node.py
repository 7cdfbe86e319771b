"""The node that serves the subject's screen and the operator's page.

| topic | direction | type | what |
| --- | --- | --- | --- |
| impedance/estimate | in | Float64MultiArray | t[s],K[N.m/rad],G[N.m.s/rad],valid[1]: the cursor |
| ankle/samples | in | Float64MultiArray | t[s],position[rad],velocity[rad/s],torque[N.m] |
| emg/samples | in | Float64MultiArray | t[s],SOL[V],TA[V],GL[V],GM[V]: traces, activity |
| emg/responses | in, in a course | Float64MultiArray | each onset: the reflex of a trial |
| /diagnostics | in, out | DiagnosticArray | health, recording, free disk; own frames and pages |
| rig/state | in | String | state of the rig's driver |
| rig/operator_alive | out | String | 10 Hz while an operator's page is alive: id of the session |
| session/event | out | String | holds, targets, start, pause, stop, faults, notes |

Services that it calls: `arm`, `start`, `stop`, `reset_fault` of the rig's driver
(std_srvs/Trigger), `perturb` of the perturbation generator in a conditioning course, parameters of
`ankle_sim`.

Threads: the executor takes the graph's messages; `SessionRunner` has the session and its clock;
`RigServices` the calls to the rig; the pages' server and the file with the progress have one each.
`LiveSignals` and `SessionRunner.view` are what they share.
Parameters: `biofeedback.parameters`.
"""

from __future__ import annotations

import asyncio
import threading
import time
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String

from ankle_interfaces.block import Block
from ankle_interfaces.continuity import Finding
from ankle_interfaces.topics import (
    ANKLE_SAMPLES,
    DIAGNOSTICS,
    EMG_RESPONSES,
    EMG_SAMPLES,
    IMPEDANCE_ESTIMATE,
    MUSCLES,
    SESSION_EVENT,
)
from ankle_node.node import WARN, AnkleNode, run
from ankle_node.qos import publisher_qos
from ankle_node.real_time import PAGES_PRIORITY, keep_loaded_objects, take_priority
from ankle_node.session_event import SessionEvent
from biofeedback import parameters as declared
from biofeedback.errors import CommandError
from biofeedback.live_signals import LiveSignals
from biofeedback.session import saved_session
from biofeedback.session.calibration_files import file_checks
from biofeedback.session.course import load_course
from biofeedback.session.course_file import CourseFile
from biofeedback.session.perturbation_request import PerturbationRequest
from biofeedback.session.protocol import load_protocol
from biofeedback.session.rig_services import RigServices
from biofeedback.session.runner import SessionRunner
from biofeedback.session.session_program import ARMED, RUNNING, Session
from biofeedback.session.simulated_subject import SimulatedSubject
from biofeedback.web.access import Access, is_loopback, tls_context
from biofeedback.web.presenter import Presenter
from biofeedback.web.server import Server

ESTIMATE = ("K[N.m/rad]", "G[N.m.s/rad]", "valid[1]")
LOOK_PERIOD = 1.0  # s; how soon a simulated subject that starts later is seen
SAVE_PERIOD = 1.0  # s; what a crash may cost of a step's clock
START_PATIENCE = 10.0  # s
# A recorder hears a node that was started anew only once the two have found each other: events wait
# for it, with the times they have.
DISCOVERY, LONGEST_DISCOVERY = 2.0, 10.0  # s; with a reader, without one
EVENTS_PERIOD = 0.2  # s; how often events that wait for a reader are tried again
DIAGNOSTICS_KEPT = 50  # every node reports once a second, and at once what is wrong
STOP_PATIENCE = 1.0  # s; for the rig to confirm the stop of a node that ends


PARAMETERS = declared.PARAMETERS


class BiofeedbackNode(AnkleNode):
    """Wires topics to signals, and the session to rig and pages."""

    def __init__(self) -> None:
        super().__init__("biofeedback", PARAMETERS)
        host = self.text("host")
        self._access = Access(host, self.text("token"))
        self._tls = tls_context(self.text("certificate"), self.text("key"))
        self._course = self._open_course()
        session = (
            Session(load_protocol(self.text("protocol")))
            if self._course is None
            else Session(next_of_course=self._course.next_session)
        )
        self._signals = LiveSignals(self.number("torque_cutoff"), MUSCLES)
        self._rig, self._subject = RigServices(self, self.text("rig")), SimulatedSubject(self)
        self._events = self.create_publisher(
            String, SESSION_EVENT.name, publisher_qos(SESSION_EVENT)
        )
        self._unsent: deque[SessionEvent] = deque()
        self._unlogged: deque[SessionEvent] = deque()
        self._happened = self.create_guard_condition(self._send_events)
        self._runner = SessionRunner(
            session,
            self._signals,
            self._rig,
            self._subject,
            self._record,
            self.now,
            self._keep_progress,
            None if self._course is None else PerturbationRequest(self),
            file_checks(
                self.text("rig_file"),
                self.number("rig_calibration_days"),
                self.text("subject_file"),
            ),
        )
        subject, visit = self.text("subject"), int(self.number("visit"))
        presenter = Presenter(
            self._signals,
            self.number("cursor_frequency"),
            self.text("language"),
            ", visit ".join([subject, str(visit)]) if subject and visit else subject,
        )
        self._server = Server(
            self._runner,
            presenter,
            self._access,
            self.now,
            self.number("frame_rate"),
            self._tls,
        )
        if refusal := take_priority(PAGES_PRIORITY):
            self.get_logger().warning(refusal)
        self._began = time.monotonic()
        self._failure: Exception | None = None
        self._failed = self.create_guard_condition(self._raise_failure)
        self._loop, self._stopped = asyncio.new_event_loop(), asyncio.Event()
        self._serving = threading.Event()
        self._progress: saved_session.ProgressWriter | None = None
        self._saved, self._saved_at = session.saved(), time.monotonic()
        self._thread = threading.Thread(
            target=self._serve, args=(host, int(self.number("port"))), name="pages", daemon=True
        )
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(LOOK_PERIOD, self._look, clock=steady)
        self.create_timer(EVENTS_PERIOD, self._send_events, clock=steady)
        self._look()
        self._ankle = self.block_subscription(ANKLE_SAMPLES, self._take_samples)
        self.block_subscription(IMPEDANCE_ESTIMATE, self._take_estimates, ESTIMATE)
        self._emg = self.block_subscription(EMG_SAMPLES, self._take_emg)
        if self._course is not None:
            self.block_subscription(EMG_RESPONSES, self._take_responses)
        self.create_subscription(
            DiagnosticArray, DIAGNOSTICS.name, self._take_diagnostics, DIAGNOSTICS_KEPT
        )
        self._thread.start()
        if not self._serving.wait(START_PATIENCE) or self._failure is not None:
            self._runner.close()
            self._rig.close()
            raise self._failure or OSError(f"the pages were not there within {START_PATIENCE:g} s")

    def _open_course(self) -> CourseFile | None:
        """Make the course that this node leads, from the record of its subject."""
        if not self.text("course"):
            return None
        subject = self.text("subject")
        named = self.text("course_record")
        path = Path(named) if named else saved_session.state_folder() / f"course_{subject}.yaml"
        return CourseFile(path, load_course(self.text("course")), subject, self._warn_of_progress)

    def _serve(self, host: str, port: int) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._server.run(host, port, self._ready, self._stopped))
        except Exception as error:
            self._failure = error
            self._serving.set()
            self._failed.trigger()

    def _raise_failure(self) -> None:
        """Raise the error of the pages' thread in the executor, so that it ends the process."""
        if self._failure is not None:
            raise self._failure

    def _ready(self, port: int) -> None:
        named = self.text("state_file")
        path = Path(named) if named else saved_session.default_path(port)
        self._progress = saved_session.ProgressWriter(path, self._warn_of_progress)
        self._resume(path)
        self._runner.start()
        host = self.text("host")
        scheme = "https" if self._tls is not None else "http"
        shown = host if is_loopback(host) else f"{host} (or this computer's name)"
        base = f"{scheme}://{shown}:{port}"
        self.get_logger().info(f"subject's screen: {base}/   operator's page: {base}/operator")
        if self._access.needs_token:
            links = path.with_name(path.name + ".links")
            saved_session.write_private(
                links,
                "".join(
                    f"{role}: {base}/enter#{token}\n"
                    for role, token in self._access.tokens().items()
                ),
            )
            self.get_logger().info(f"the addresses with their tokens are in {links}")
        keep_loaded_objects()
        self._serving.set()

    def _resume(self, path: Path) -> None:
        try:
            found = saved_session.load(path, time.time(), self.number("resume_within"))
            if found is not None and (
                found.get("state") not in ("idle", "finished")
                or found.get("index")
                or found.get("checks")
            ):
                self._runner.resume(found)
                self.get_logger().info(
                    f"continuing the session in {path}: {found['state']}, step {found['index'] + 1}"
                )
        except CommandError as error:
            self.get_logger().warning(str(error))
            self.health("saved session", WARN, str(error))

    def _warn_of_progress(self, reason: str) -> None:
        self.health("saved session", WARN, reason)

    def _keep_progress(self, present: dict[str, Any]) -> None:
        """Keep progress on disk: at each step, and once a second while the clock runs."""
        conditioning = self._runner.session.conditioning
        if self._course is not None and conditioning is not None:
            self._course.keep(conditioning.session)
        timeless = {"elapsed": 0.0, "clock": 0.0}
        stepped = {**present, **timeless} != {**self._saved, **timeless}
        if not stepped and (
            present == self._saved or time.monotonic() - self._saved_at < SAVE_PERIOD
        ):
            return
        self._saved, self._saved_at = present, time.monotonic()
        if self._progress is not None:
            self._progress.keep(present)

    def _record(self, event: SessionEvent) -> None:
        """Hand an event of the session's thread to the executor's."""
        self._unlogged.append(event)
        self._unsent.append(event)
        self._happened.trigger()

    def _send_events(self) -> None:
        """Log events, and publish them as soon as the readers are there."""
        while self._unlogged:
            self.get_logger().info(self._unlogged.popleft().line())
        running = time.monotonic() - self._began
        if running > LONGEST_DISCOVERY or (
            running > DISCOVERY and self._events.get_subscription_count()
        ):
            while self._unsent:
                self._events.publish(String(data=self._unsent.popleft().line()))

    def _look(self) -> None:
        self._subject.look()
        self.count("frames made late", self._server.late_frames)
        self.count("pages closed for what they sent", self._server.closed_for_cause)

    def _take_samples(self, block: Block, findings: list[Finding]) -> None:
        if not (len(block.data) and self._ankle.rate):
            return
        velocity = (
            block.column("velocity[rad/s]")
            if block.has("velocity[rad/s]")
            else np.zeros(len(block.data))
        )
        columns = (block.time, block.column("position[rad]"), velocity, block.column("torque[N.m]"))
        self._signals.feed_samples(np.column_stack(columns), self._ankle.rate, time.monotonic())

    def _take_estimates(self, block: Block, findings: list[Finding]) -> None:
        self._signals.feed_estimates(block.data, time.monotonic())

    def _take_emg(self, block: Block, findings: list[Finding]) -> None:
        if self._emg.rate:
            self._signals.feed_emg(block.data, self._emg.rate, time.monotonic())

    def _take_responses(self, block: Block, findings: list[Finding]) -> None:
        self._signals.feed_responses(block.data)

    def _take_diagnostics(self, message: DiagnosticArray) -> None:
        namespace = f"{self.get_namespace().rstrip('/')}/"
        for status in message.status:
            owner, slash, name = status.name.rpartition("/")
            if slash and f"{owner}/" != namespace:  # of another laboratory
                continue
            figures = {value.key: value.value for value in status.values}
            self._signals.feed_status(
                name, status.level[0], status.message, figures, time.monotonic()
            )

    def process_waiting(self, executor: SingleThreadedExecutor) -> None:
        """Stop the rig first when this node is ended in the middle of a session."""
        if self._runner.view.state in (ARMED, RUNNING):
            self._runner.stop("the screens were ended")
            deadline = time.monotonic() + STOP_PATIENCE
            while self._rig.waits_for_stop and time.monotonic() < deadline:
                executor.spin_once(timeout_sec=0.02)
        super().process_waiting(executor)

    def destroy_node(self) -> None:
        """Close the pages, then the session, then the way to the rig."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._stopped.set)
            self._thread.join(timeout=5.0)
        self._runner.close()
        self._send_events()
        if self._progress is not None:
            self._progress.close()
        if self._course is not None:
            self._course.close()
        self._rig.close()
        super().destroy_node()


def main() -> int:
    """Start the node: the entry point of ``ros2 run biofeedback biofeedback``."""
    return run(BiofeedbackNode)
