"""A virtual rig and subject behind the topics of the real one.

| topic | direction | content |
| --- | --- | --- |
| perturbation/reference | in | t[s],position[rad],velocity[rad/s],acceleration[rad/s^2] |
| ankle/samples | out, as the reference | t[s],position[rad],velocity[rad/s],torque[N.m] |
| joint_states | out, each block | JointState, name `ankle`: the last sample |
| ankle/truth | out, one row each block | t[s],K[N.m/rad],G[N.m.s/rad],voluntary_torque[N.m] |
| emg/samples | out, with a subject | t[s],SOL[V],TA[V],GL[V],GM[V] |
| session/event | out, with holds | String: hold started, hold ended |
| rig/state | out, latched, each change | String: running, armed or ready, as a rig's driver |
| ~/arm, ~/start, ~/stop, ~/reset_fault | service | Trigger, as a rig's driver |
| /diagnostics | out, 1 Hz | samples, held samples, load |

A reference may carry the position alone. A term that the model lacks is NaN in ankle/truth. The
node advances by the samples of the reference, never by timers: it is as fast as its input. A
simulated subject (parameter `subject`) sets K, G and the voluntary torque by what its muscles do. A
value that is set by hand then (``ros2 param set /ankle_sim K 120.0``) is kept until the subject's
state is set or its next hold begins. Parameters: `ankle_sim.parameters`,
`ankle_sim.subject_parameters`.
"""

from __future__ import annotations

import time

import numpy as np
from std_msgs.msg import String

from ankle_interfaces.block import Block
from ankle_interfaces.continuity import Finding
from ankle_interfaces.errors import BlockError, QuantityError
from ankle_interfaces.quantity import Value
from ankle_interfaces.topics import (
    ANKLE_SAMPLES,
    ANKLE_TRUTH,
    EMG_SAMPLES,
    PERTURBATION_REFERENCE,
    SESSION_EVENT,
)
from ankle_node.derived_topics import joint_states
from ankle_node.node import ERROR, WARN, AnkleNode, run
from ankle_node.qos import publisher_qos
from ankle_physics.errors import ModelError
from ankle_physics.model import Model
from ankle_sim import start_setup
from ankle_sim.live_rig import LiveRig, Setup, Stretch
from ankle_sim.live_subject import SUBJECT_PARAMETER_SYMBOLS, LiveSubject
from ankle_sim.parameters import model_parameters
from ankle_sim.reference_motion import motion_of
from ankle_sim.rest import Rest
from ankle_sim.rest_services import RestServices
from ankle_sim.start_setup import MODEL_CHOICE, holds_from, make_model, setup_from, state_from
from ankle_sim.start_values import start_value
from ankle_sim.subject_parameters import STATE_PARAMETERS, SUBJECT
from ankle_sim.virtual_subject import draw_subject

NAME = "ankle_sim"
WARM_UP_RATE = 2048.0
"""The warm-up compiles and prepares for this rate [Hz]; any other rate works too."""
declared_parameters = start_setup.declared_parameters


class AnkleSimNode(AnkleNode):
    """Connects a `LiveRig` to its topics.

    Parameters
    ----------
    model
        The joint; its values are the defaults of the model's parameters.
    """

    def __init__(self, model: Model) -> None:
        self._of_model = model_parameters(model)
        parameters = start_setup.parameters_of(model)
        super().__init__(NAME, parameters)
        self.hardware_id = "simulated rig"
        values = {parameter.name: self.value(parameter.name) for parameter in parameters}
        setup = setup_from(model, values)
        self._rest = Rest(bool(values["at_rest"]))
        self._subject: LiveSubject | None = None
        if values[SUBJECT.name]:
            self._rig = self._make_subject(setup, values)
        else:
            self._rig = LiveRig(setup, self._report, bool(values["noise"]))
        self._samples = self.block_publisher(ANKLE_SAMPLES)
        self._truth = self.block_publisher(ANKLE_TRUTH)
        self._joint = joint_states(self)
        self._simulated, self._busy = 0, 0.0
        self.get_logger().info("preparing (compiles the simulation at the first start, about 20 s)")
        noise = self._rig.noise_deviations(WARM_UP_RATE)
        self.when_read(ANKLE_SAMPLES, int(self.number("wait_for_readers")), self._begin)
        terms = ", ".join(entry.term.name for entry in model.entries)
        self.get_logger().info(
            f"ready; model: {terms}; scenario: {setup.scenario.title or 'none'}; "
            f"noise {noise[0]:.2g} rad, {noise[1]:.2g} rad/s, {noise[2]:.2g} N.m (standard "
            "deviations)"
        )

    def _make_subject(self, setup: Setup, values: dict[str, Value]) -> LiveRig:
        subject = draw_subject(int(values[SUBJECT.name]))
        noisy = bool(values["noise"])
        self._subject = LiveSubject(setup, subject, holds_from(values), self._report, noisy)
        self._subject.command(state_from(values))
        self._emg = self.block_publisher(EMG_SAMPLES)
        self._events = self.create_publisher(
            String, SESSION_EVENT.name, publisher_qos(SESSION_EVENT)
        )
        return self._subject.rig

    def parameters_changed(self, values: dict[str, Value]) -> None:
        """Let model parameters, noise and the subject's state hold from the next block on."""
        changes = [
            (*self._of_model[name][1:], float(value))
            for name, value in values.items()
            if name in self._of_model
        ]
        try:
            for change in changes:
                self._rig.check(*change)
        except ModelError as error:
            raise QuantityError(str(error)) from None
        if self._subject is not None and any(p.name in values for p in STATE_PARAMETERS):
            present = {p.name: self.number(p.name) for p in STATE_PARAMETERS}
            self._subject.command(state_from({**present, **values}))
        for change in changes:
            if self._subject is not None and change[:2] in SUBJECT_PARAMETER_SYMBOLS:
                self._subject.fix(*change)
            else:
                self._rig.set(*change)
        self._rig.noisy = bool(values.get("noise", self._rig.noisy))

    def _begin(self) -> None:
        self._rest_services = RestServices(self, self._rest)
        self._continuity = self.block_subscription(PERTURBATION_REFERENCE, self._take)

    def _take(self, block: Block, findings: list[Finding]) -> None:
        started = time.process_time()
        try:
            stamps, reference, shortcoming = motion_of(block)
            if shortcoming:
                self.health("reference", WARN, shortcoming)
            stretches = self._simulate(stamps, self._rest.motion(stamps, reference))
        except (BlockError, ModelError) as error:
            self._refuse(str(error))
            return
        for stretch in stretches:
            self._publish(stretch)
        self._continuity.rate = self._rig.rate
        self._simulated += sum(len(stretch.time) for stretch in stretches)
        self._busy += time.process_time() - started
        self.count("samples", self._simulated)
        self.count("held samples", self._rig.held)
        if self._simulated and self._rig.rate:
            self.count(
                "processor time of the simulation [%]",
                f"{100.0 * self._busy * self._rig.rate / self._simulated:.2f}",
            )

    def _simulate(self, stamps: np.ndarray, reference: np.ndarray) -> list[Stretch]:
        if self._subject is None:
            return self._rig.take(stamps, reference)
        pieces, events = self._subject.take(stamps, reference)
        for event in events:
            self._events.publish(String(data=event.line()))
        for piece in pieces:
            self._emg(np.column_stack([piece.stretch.time, piece.emg]))
        return [piece.stretch for piece in pieces]

    def _publish(self, stretch: Stretch) -> None:
        samples = np.column_stack([stretch.time, stretch.samples])
        self._samples(samples)
        self._joint(samples)
        self._truth(stretch.truth_row[np.newaxis])

    def _report(self, sentence: str) -> None:
        self.get_logger().warning(sentence, throttle_duration_sec=1.0)
        self.health("simulation", WARN, sentence)

    def _refuse(self, sentence: str) -> None:
        self.get_logger().error(sentence, throttle_duration_sec=1.0)
        self.health("simulation", ERROR, sentence)


def make() -> AnkleSimNode:
    """Make the node with the model that its parameters name."""
    return AnkleSimNode(
        make_model({parameter.name: start_value(NAME, parameter) for parameter in MODEL_CHOICE})
    )


def main() -> int:
    """Start the node: the entry point of ``ros2 run ankle_sim ankle_sim``."""
    return run(make)
