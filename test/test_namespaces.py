"""Two laboratories in one ROS domain, each in a namespace, and a second source of one signal."""

import time

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Float64, Float64MultiArray

from ankle_bringup.graph import load_graph
from ankle_bringup.live_graph import observer
from ankle_bringup.processes import Processes
from ankle_interfaces.block import unpack
from ankle_interfaces.topics import (
    ANKLE_SAMPLES,
    ANKLE_TRUTH,
    DIAGNOSTICS,
    PERTURBATION_REFERENCE,
)
from ankle_node.qos import reader_qos
from ankle_node.sources import publishers
from session_recorder.bag_reader import BagReader

pytestmark = [pytest.mark.live, pytest.mark.timeout(240)]

PATIENCE = 90.0
STIFFNESS = {"left": 60.0, "right": 140.0}


def laboratory(side, folder):
    """Perturbation, simulated ankle and recorder of one side."""
    graph = load_graph("simulated_recorded").without("impedance_estimator").in_namespace(side)
    return graph.with_settings(
        [
            f"ankle_sim.K={STIFFNESS[side]}",
            f"record.out={folder / side}",
            "ankle_sim.wait_for_readers=1",
            "perturbation_generator.wait_for_readers=2",
        ]
    )


class Ear:
    """Reads what both sides and the whole domain say."""

    def __init__(self, node):
        self.node = node
        self.truth = {side: set() for side in STIFFNESS}
        self.torque = {side: [] for side in STIFFNESS}
        self.status = {}
        for side in STIFFNESS:
            self._listen(side)
        node.create_subscription(DiagnosticArray, DIAGNOSTICS.name, self._health, 64)

    def _listen(self, side):
        def stiffness(message):
            self.truth[side] |= set(unpack(message).column("K[N.m/rad]"))

        self.node.create_subscription(
            Float64MultiArray,
            f"/{side}/{ANKLE_TRUTH.name}",
            stiffness,
            reader_qos(ANKLE_TRUTH),
            raw=True,
        )
        self.node.create_subscription(
            Float64, f"/{side}/ankle/torque", lambda m: self.torque[side].append(m.data), 10
        )

    def _health(self, message):
        for status in message.status:
            self.status[status.name] = status

    def until(self, condition, what):
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, f"not within {PATIENCE:g} s: {what}"
            rclpy.spin_once(self.node, timeout_sec=0.1)


def test_two_laboratories_keep_apart_and_a_second_source_is_named(tmp_path):
    with (
        observer("ear") as node,
        Processes(laboratory("left", tmp_path), tmp_path / "left_logs"),
        Processes(laboratory("right", tmp_path), tmp_path / "right_logs"),
    ):
        ear = Ear(node)
        ear.until(lambda: all(len(ear.torque[side]) > 30 for side in STIFFNESS), "torque of both")
        rigs = [f"/{side}/ankle_sim" for side in STIFFNESS]
        ear.until(lambda: all(rig in ear.status for rig in rigs), "status of both rigs")
        assert ear.truth == {side: {K} for side, K in STIFFNESS.items()}
        for side in STIFFNESS:
            topic = f"/{side}/{ANKLE_SAMPLES.name}"
            assert publishers(node, topic) == [f"/{side}/ankle_sim"]
            status = ear.status[f"/{side}/ankle_sim"]
            assert (status.level, status.hardware_id) == (b"\0", "simulated rig")
            assert publishers(node, f"/{ANKLE_SAMPLES.name}") == []

        # Somebody starts a second perturbation on the left: whoever reads it names both.
        intruder = node.create_publisher(
            Float64MultiArray,
            f"/left/{PERTURBATION_REFERENCE.name}",
            reader_qos(PERTURBATION_REFERENCE),
        )
        names = f"(/{node.get_name()}, /left/perturbation_generator)"
        for reader in ("ankle_sim", "record"):
            ear.until(
                lambda reader=reader: names in ear.status[f"/left/{reader}"].message,
                f"{reader} names both sources",
            )
            assert ear.status[f"/left/{reader}"].level > b"\0"
            assert names not in ear.status[f"/right/{reader}"].message
        node.destroy_publisher(intruder)
    for side, K in STIFFNESS.items():
        bag = BagReader(tmp_path / side)
        # Its own laboratory alone, under the names that every reader of a bag knows.
        assert not [name for name in bag.topics if "left" in name or "right" in name]
        assert bag.custom_data["namespace"] == f"/{side}"
        columns, rows = bag.signal(ANKLE_TRUTH.absolute)
        assert set(rows[:, columns.index("K[N.m/rad]")]) == {K}
