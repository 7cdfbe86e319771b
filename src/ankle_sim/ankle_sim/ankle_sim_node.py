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
state is set or its next hold begins. Parameters: `ankle_sim.parameters`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from std_msgs.msg import String
from std_srvs.srv import Trigger

from ankle_interfaces.block import Block
from ankle_interfaces.continuity import Finding
from ankle_interfaces.errors import BlockError, QuantityError
from ankle_interfaces.quantity import Quantity, Value
from ankle_interfaces.topics import (
    ANKLE_SAMPLES,
    ANKLE_TRUTH,
    EMG_SAMPLES,
    PERTURBATION_REFERENCE,
    RIG_STATE,
    SESSION_EVENT,
)
from ankle_node.derived_topics import joint_states
from ankle_node.node import ERROR, WARN, AnkleNode, run
from ankle_node.qos import publisher_qos
from ankle_physics.actuator import Servo
from ankle_physics.errors import ModelError
from ankle_physics.model import Model
from ankle_physics.own_terms import load_terms
from ankle_physics.rig_file import RigFile
from ankle_physics.scenario import Scenario
from ankle_physics.sensors import SignalToNoise
from ankle_sim.live_rig import LiveRig, Setup, Stretch
from ankle_sim.live_subject import SUBJECT_PARAMETER_SYMBOLS, LiveSubject, subject_model
from ankle_sim.parameters import (
    MODEL,
    RIG,
    RIG_PARAMETERS,
    STATE_PARAMETERS,
    SUBJECT,
    SUBJECT_PARAMETERS,
    TERMS,
    VOLUNTARY_TORQUE,
    model_parameters,
    with_voluntary_torque,
)
from ankle_sim.procedure import some_holds
from ankle_sim.rest import Rest
from ankle_sim.start_values import start_value
from ankle_sim.virtual_subject import State, draw_subject

NAME = "ankle_sim"
USUAL_RATE = 2048.0
"""The warm-up compiles and prepares for this rate [Hz]; any other rate works too."""


class AnkleSimNode(AnkleNode):
    """Connects a `LiveRig` to its topics.

    Parameters
    ----------
    model
        The joint; its values are the defaults of the model's parameters.
    """

    def __init__(self, model: Model) -> None:
        self._of_model = model_parameters(model)
        super().__init__(
            NAME,
            [
                *RIG_PARAMETERS,
                *SUBJECT_PARAMETERS,
                *(declared for declared, _, _ in self._of_model.values()),
            ],
        )
        self.hardware_id = "simulated rig"
        for name, (_, term, symbol) in self._of_model.items():
            model.entry(term).values[symbol] = self.number(name)
        scenario = Scenario.load(self.text("scenario")) if self.text("scenario") else Scenario([])
        setup = Setup(
            model,
            Servo(self.number("actuator_bandwidth"), self.number("actuator_damping")),
            SignalToNoise(
                self.number("snr_position"), self.number("snr_velocity"), self.number("snr_torque")
            ),
            scenario,
            self.number("noise_amplitude"),
            int(self.number("seed")),
            RigFile.load(self.text("rig")) if self.text("rig") else None,
        )
        self._subject: LiveSubject | None = None
        if self.value(SUBJECT.name):
            self._rig = self._make_subject(setup)
        else:
            self._rig = LiveRig(setup, self._report, bool(self.value("noise")))
        self._samples = self.block_publisher(ANKLE_SAMPLES)
        self._truth = self.block_publisher(ANKLE_TRUTH)
        self._joint = joint_states(self)
        self._simulated, self._busy = 0, 0.0
        self.get_logger().info("preparing (compiles the simulation at the first start, about 20 s)")
        noise = self._rig.noise_deviations(USUAL_RATE)
        self.when_read(ANKLE_SAMPLES, int(self.number("wait_for_readers")), self._begin)
        terms = ", ".join(entry.term.name for entry in model.entries)
        self.get_logger().info(
            f"ready; model: {terms}; scenario: {scenario.title or 'none'}; "
            f"noise {noise[0]:.2g} rad, {noise[1]:.2g} rad/s, {noise[2]:.2g} N.m (standard "
            "deviations)"
        )

    def _make_subject(self, setup: Setup) -> LiveRig:
        subject = draw_subject(int(self.number(SUBJECT.name)))
        holds = some_holds(
            int(self.number("holds")),
            setup.seed,
            self.number("hold_duration"),
            self.number("reach_duration"),
        )
        self._subject = LiveSubject(setup, subject, holds, self._report, bool(self.value("noise")))
        self._subject.command(
            State(**{parameter.name: self.number(parameter.name) for parameter in STATE_PARAMETERS})
        )
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
            self._subject.command(
                State(
                    **{
                        p.name: float(values.get(p.name, self.number(p.name)))
                        for p in STATE_PARAMETERS
                    }
                )
            )
        for change in changes:
            if self._subject is not None and change[:2] in SUBJECT_PARAMETER_SYMBOLS:
                self._subject.fix(*change)
            else:
                self._rig.set(*change)
        self._rig.noisy = bool(values.get("noise", self._rig.noisy))

    def _begin(self) -> None:
        self._offer_services()
        self._continuity = self.block_subscription(PERTURBATION_REFERENCE, self._take)

    def _offer_services(self) -> None:
        """Offer what a rig's driver offers, so that a stop on a page stops the perturbation."""
        self._rest = Rest(bool(self.value("at_rest")))
        self._rig_state = self.create_publisher(String, RIG_STATE.name, publisher_qos(RIG_STATE))
        for action in ("arm", "start", "stop", "reset_fault"):
            self.create_service(Trigger, f"~/{action}", partial(self._answer, action))
        self._rig_state.publish(String(data=self._rest.state))

    def _answer(
        self, action: str, request: Trigger.Request, answer: Trigger.Response
    ) -> Trigger.Response:
        found = getattr(self._rest, action)() if action != "reset_fault" else "there is no fault"
        answer.success = found is not None
        answer.message = found if found is not None else f"{self._rest.state}: arm first"
        self._rig_state.publish(String(data=self._rest.state))
        return answer

    def _take(self, block: Block, findings: list[Finding]) -> None:
        started = time.process_time()
        try:
            stamps, reference = self._motion(block)
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

    def _motion(self, block: Block) -> tuple[np.ndarray, np.ndarray]:
        data = block.data
        if block.columns != PERTURBATION_REFERENCE.columns:
            data = data[:, :2]
            self.health(
                "reference",
                WARN,
                "without velocity and acceleration; position taken as linear between samples",
            )
        return data[:, 0], data[:, 1:]

    def _publish(self, stretch: Stretch) -> None:
        samples = np.column_stack([stretch.time, stretch.samples])
        self._samples(samples)
        self._joint(samples)
        voluntary = stretch.parts.get(VOLUNTARY_TORQUE, math.nan)
        row = [
            stretch.truth.get("stiffness.K[N.m/rad]", math.nan),
            stretch.truth.get("reflex.G[N.m.s/rad]", math.nan),
            voluntary,
        ]
        self._truth(np.array([[stretch.time[-1], *row]]))

    def _report(self, sentence: str) -> None:
        self.get_logger().warning(sentence, throttle_duration_sec=1.0)
        self.health("simulation", WARN, sentence)

    def _refuse(self, sentence: str) -> None:
        self.get_logger().error(sentence, throttle_duration_sec=1.0)
        self.health("simulation", ERROR, sentence)


def make_model(values: Mapping[str, Any]) -> Model:
    """Make the model that the parameters `model`, `subject`, `terms` and `rig` name."""
    load_terms(str(values.get(TERMS.name, "")))
    path, subject = str(values.get(MODEL.name, "")), int(values.get(SUBJECT.name, 0))
    rig = str(values.get(RIG.name, ""))
    if path:
        model = with_voluntary_torque(Model.load(path))
    elif subject:
        model = subject_model(draw_subject(subject))
    else:
        model = with_voluntary_torque(Model.of())
    return RigFile.load(rig).twin(model) if rig else model


def declared_parameters(values: Mapping[str, Any]) -> list[Quantity]:
    """Return the parameters for these start values; they depend on the node's model."""
    of_model = model_parameters(make_model(values))
    return [
        *RIG_PARAMETERS,
        *SUBJECT_PARAMETERS,
        *(declared for declared, _, _ in of_model.values()),
    ]


def make() -> AnkleSimNode:
    """Make the node with the model that its parameters name."""
    return AnkleSimNode(
        make_model(
            {
                parameter.name: start_value(NAME, parameter)
                for parameter in (MODEL, TERMS, SUBJECT, RIG)
            }
        )
    )


def main() -> int:
    """Start the node: the entry point of ``ros2 run ankle_sim ankle_sim``."""
    return run(make)
