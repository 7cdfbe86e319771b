"""The driver's services over DDS, in one process: no command waits for another one's answer."""

import threading
import time

import pytest
import rclpy
from std_srvs.srv import Trigger

from ankle_actuator_driver import ankle_actuator_driver_node as driver_module
from ankle_actuator_driver.safety.states import Answer, State
from ankle_node.block_executor import BlockExecutor

pytestmark = [pytest.mark.live, pytest.mark.untimed]
PATIENCE = 20.0  # s


class RigThatNeverConfirms:
    """A session whose arming is carried out and never confirmed."""

    def __init__(self):
        self.commands = []
        self.waited_after = set()

    def operate(self, name):
        self.commands.append(name)
        return Answer(True, name)

    def confirmed(self, state):
        assert state is State.ARMED
        self.waited_after.add(self.commands[-1])
        return None

    def tell_sources(self, names, readers):
        pass


@pytest.fixture
def driver(monkeypatch):
    monkeypatch.setattr(driver_module, "take_priority", lambda priority: "")
    rclpy.init(args=["test", "--ros-args", "-p", "autostart:=false"])
    node = driver_module.ActuatorDriverNode()
    yield node
    node._session = None
    node.destroy_node()
    rclpy.try_shutdown()


def test_a_stop_is_carried_out_while_an_arming_waits_for_the_rig(driver):
    rig = driver._session = RigThatNeverConfirms()
    page = rclpy.create_node("page")
    executors = [BlockExecutor() for _ in range(2)]
    for executor, node in zip(executors, (driver, page), strict=True):
        executor.add_node(node)
    ended = threading.Event()

    def spin():
        while not ended.is_set():
            executors[0].spin_once(timeout_sec=0.1)

    thread = threading.Thread(target=spin, daemon=True)
    thread.start()
    clients = {
        name: page.create_client(Trigger, f"ankle_actuator_driver/{name}")
        for name in ("arm", "stop")
    }

    def until(condition):
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, f"not reached; the rig heard {rig.commands}"
            executors[1].spin_once(timeout_sec=0.01)

    try:
        until(lambda: all(client.service_is_ready() for client in clients.values()))
        arming = clients["arm"].call_async(Trigger.Request())
        until(lambda: rig.commands == ["arm"])
        stopping = clients["stop"].call_async(Trigger.Request())
        until(lambda: stopping.done() and arming.done())
        assert "stop" in rig.waited_after, "the stop waited for the arming's answer"
        assert "did not confirm it" in arming.result().message
    finally:
        ended.set()
        thread.join(timeout=5.0)
        for executor in executors:
            executor.shutdown()
        page.destroy_node()
