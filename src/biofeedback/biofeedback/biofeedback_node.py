"""The node that serves the subject's screen and the operator's page.

| topic | direction | type | what |
| --- | --- | --- | --- |
| impedance/estimate | in | Float64MultiArray | t[s],K[N.m/rad],G[N.m.s/rad],valid[1]: the cursor |
| ankle/samples | in | Float64MultiArray | t[s],position[rad],velocity[rad/s],torque[N.m] |
| emg/samples | in | Float64MultiArray | t[s],SOL[V],TA[V],GL[V],GM[V]: traces, activity |
| emg/responses | in, in a course | Float64MultiArray | each onset: the reflex of a trial |
| impedance/provenance | in | String | the model that the estimates are made with |
| /diagnostics | in, out | DiagnosticArray | health, recording, free disk; own frames and pages |
| rig/state | in | String | state of the rig's driver |
| rig/operator_alive | out | String | 10 Hz while an operator's page is alive: id of the session |
| session/event | out | String | holds, targets, start, pause, stop, faults, notes |

Services that it calls: `arm`, `start`, `stop`, `reset_fault` of the rig's driver
(std_srvs/Trigger), `perturb` of the perturbation generator in a conditioning course, parameters of
`ankle_sim`, the parameter `model` of the estimator.

Threads: the executor takes the graph's messages; `SessionRunner` has the session and its clock;
`RigServices` the calls to the rig; the pages' server and the file with the progress have one each.
`LiveSignals` and `SessionRunner.view` are what they share.
Parameters: `biofeedback.parameters`.
"""

from __future__ import annotations

import time
from pathlib import Path

from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String

from ankle_interfaces.topics import MUSCLES, SESSION_EVENT
from ankle_node.node import WARN, AnkleNode, run
from ankle_node.qos import publisher_qos
from ankle_node.real_time import PAGES_PRIORITY, keep_loaded_objects
from biofeedback.errors import CommandError
from biofeedback.graph_signals import GraphSignals
from biofeedback.live_signals import LiveSignals
from biofeedback.parameters import PARAMETERS
from biofeedback.session.calibration_choice import calibration_of
from biofeedback.session.calibration_files import file_checks, subject_file_of
from biofeedback.session.course import load_course
from biofeedback.session.course_file import CourseFile
from biofeedback.session.estimator_model import ModelOfEstimator
from biofeedback.session.event_outbox import EventOutbox
from biofeedback.session.perturbation_request import PerturbationRequest
from biofeedback.session.rig_services import RigServices
from biofeedback.session.runner import SessionRunner
from biofeedback.session.saved_session import default_path, state_folder
from biofeedback.session.session_files import SessionFiles
from biofeedback.session.session_program import ARMED, RUNNING
from biofeedback.session.simulated_subject import SimulatedSubject
from biofeedback.web.access import Access, tls_context
from biofeedback.web.presenter import Presenter
from biofeedback.web.server import Server
from biofeedback.web.serving import Serving, addresses

LOOK_PERIOD = 1.0
"""[s] How soon a simulated subject that starts later is seen."""
EVENTS_PERIOD = 0.2
"""[s] How often events that wait for a reader are tried again."""
STOP_PATIENCE = 1.0
"""[s] How long a node that ends waits for the rig to confirm its stop."""


class BiofeedbackNode(AnkleNode):
    """Wires topics to signals, and the session to rig and pages."""

    def __init__(self) -> None:
        super().__init__("biofeedback", PARAMETERS)
        self._host = self.text("host")
        self._access = Access(self._host, self.text("token"))
        self._tls = tls_context(self.text("certificate"), self.text("key"))
        course = self._course()
        self._files = SessionFiles(self.text("protocol"), course, self._warn_of_progress)
        signals = LiveSignals(self.number("torque_cutoff"), MUSCLES)
        self._rig, self._subject = RigServices(self, self.text("rig")), SimulatedSubject(self)
        self._outbox = self._event_outbox()
        subject, visit = self.text("subject"), int(self.number("visit"))
        model = subject_file_of(
            self.text("subject_file"), subject, visit, state_folder(), time.time()
        )
        protocol, rig_file = self._files.session.protocol, self.text("rig_file")
        self._calibration = calibration_of(protocol, rig_file, model, self.get_namespace())
        self._runner = SessionRunner(
            self._files.session,
            signals,
            self._rig,
            self._subject,
            self._outbox.put,
            self.now,
            self._files.keep,
            None if course is None else PerturbationRequest(self),
            file_checks(rig_file, self.number("rig_calibration_days"), str(model)),
            self._calibration,
            ModelOfEstimator(self),
        )
        presenter = Presenter(
            signals,
            self.number("cursor_frequency"),
            self.text("language"),
            ", visit ".join([subject, str(visit)]) if subject and visit else subject,
            self.number("body_mass"),
        )
        rate = self.number("frame_rate")
        self._server = Server(self._runner, presenter, self._access, self.now, rate, self._tls)
        self.take_priority_beside_a_rig(PAGES_PRIORITY)
        port, failed = int(self.number("port")), self.create_guard_condition(self._raise_failure)
        self._serving = Serving(self._server, self._host, port, self._ready, failed.trigger)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(LOOK_PERIOD, self._look, clock=steady)
        self.create_timer(EVENTS_PERIOD, self._outbox.send, clock=steady)
        self._look()
        GraphSignals(self, signals, responses=course is not None)
        try:
            self._serving.start()
        except Exception:
            self._runner.close()
            self._rig.close()
            raise

    def _course(self) -> CourseFile | None:
        """Return the course that this node leads, from the record of its subject."""
        if not self.text("course"):
            return None
        subject = self.text("subject")
        named = self.text("course_record")
        path = Path(named) if named else state_folder() / f"course_{subject}.yaml"
        return CourseFile(path, load_course(self.text("course")), subject, self._warn_of_progress)

    def _event_outbox(self) -> EventOutbox:
        events = self.create_publisher(String, SESSION_EVENT.name, publisher_qos(SESSION_EVENT))
        return EventOutbox(
            self.get_logger().info,
            lambda line: events.publish(String(data=line)),
            events.get_subscription_count,
            self.create_guard_condition(lambda: self._outbox.send()).trigger,
        )

    def _raise_failure(self) -> None:
        """Raise the error of the pages' thread in the executor, so that it ends the process."""
        if self._serving.failure is not None:
            raise self._serving.failure

    def _ready(self, port: int) -> None:
        named = self.text("state_file")
        subject, visit = self.text("subject"), int(self.number("visit"))
        path = Path(named) if named else default_path(port, subject, visit)
        self._resume(path)
        self._runner.start()
        links = path.with_name(path.name + ".links")
        secure = self._tls is not None
        for sentence in addresses(self._access, self._host, port, secure, links):
            self.get_logger().info(sentence)
        keep_loaded_objects()

    def _resume(self, path: Path) -> None:
        try:
            found = self._files.open(path, self.number("resume_within"))
            if found is not None:
                self._runner.resume(found, time.monotonic())
                self.get_logger().info(
                    f"continuing the session in {path}: {found['state']}, step {found['index'] + 1}"
                )
        except CommandError as error:
            self.get_logger().warning(str(error))
            self._warn_of_progress(str(error))

    def _warn_of_progress(self, reason: str) -> None:
        self.health("saved session", WARN, reason)

    def _look(self) -> None:
        self._subject.look()
        self.count("frames made late", self._server.late_frames)
        self.count("pages closed for what they sent", self._server.closed_for_cause)

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
        self._serving.close()
        self._runner.close()
        self._calibration.close()
        self._outbox.send()
        self._files.close()
        self._rig.close()
        super().destroy_node()


def main() -> int:
    """Start the node: the entry point of ``ros2 run biofeedback biofeedback``."""
    return run(BiofeedbackNode)
