"""The seam for hardware: a line is one module, and a rig's computer needs neither simulator nor
compiler."""

import inspect
import subprocess
import sys
import time

import numpy as np
import pytest

from ankle_actuator_driver import link, rig_session, settings
from ankle_actuator_driver.link.rig_link import (
    Clocks,
    RigLink,
    link_class,
    link_names,
    open_link,
)
from ankle_actuator_driver.operator_commands import OperatorCommands
from ankle_actuator_driver.rig_session import LINE_CUT_REASON, RigSession, state_text
from ankle_actuator_driver.safety.bridge import Bridge
from ankle_actuator_driver.safety.limits import Limits
from ankle_actuator_driver.safety.rig import Order, Purpose, Wanted
from ankle_actuator_driver.session_setup import adjustment, open_session

VALUES = {parameter.name: parameter.default for parameter in settings.PARAMETERS}

FIELDBUS = '''
"""A line that only counts."""

from ankle_actuator_driver.link.rig_link import Arrival, RigLink
from ankle_actuator_driver.safety.rig import DeviceFault, DeviceState, RigReport, Status, Wanted

STATE = {
    Wanted.OFF: DeviceState.OFF,
    Wanted.HOLD: DeviceState.HOLD,
    Wanted.FOLLOW: DeviceState.FOLLOW,
}


class Link(RigLink):
    def __init__(self, values, clocks):
        self.clocks, self.wanted, self.stretches, self.silent = clocks, Wanted.OFF, [], False

    def send(self, order):
        if self.silent:
            return
        self.wanted = order.wanted
        self.stretches += [order.stretch] if order.stretch is not None else []

    def receive(self, timeout):
        now, ros = self.clocks.read()
        state = DeviceState.OFF if self.silent else STATE[self.wanted]  # by its own watchdog
        report = RigReport(state, DeviceFault.NONE, Status(0), True, True, True, 0.0,
                           received=1)
        return [Arrival(report, now, ros)]

    def silence(self):
        self.silent = True

    def speak(self):
        self.silent = False

    def close(self):
        self.silent = True
'''


@pytest.fixture
def fieldbus(tmp_path, monkeypatch):
    """One file more in the folder of the links."""
    (tmp_path / "fieldbus.py").write_text(FIELDBUS)
    monkeypatch.setattr(link, "__path__", [*link.__path__, str(tmp_path)])
    yield "fieldbus"
    sys.modules.pop("ankle_actuator_driver.link.fieldbus", None)


def still(first):
    """A reference at rest from a time on [s]: the plate is started once one comes."""
    return np.column_stack([first + np.arange(32) / 2048, np.zeros((32, 3))])


def test_another_line_is_one_file(fieldbus):
    assert {"udp", "emulated", "fieldbus"} <= set(link_names())
    now = [0.0]
    line = open_link(fieldbus, VALUES, Clocks(lambda: (now[0], 1e9 + now[0])))
    bridge = Bridge(Limits(), 0.5, 0.0)
    session = RigSession(bridge, line, line.clocks.read, lambda news: None, lambda error: None)
    session._look()
    assert session.operate("arm").done
    now[0] += 0.01
    session._look()
    assert session.confirmed(bridge.states.state).done
    session.refer(still(1e9 + now[0] + 0.1))
    assert session.operate("start").done
    now[0] += 0.01
    session._look()
    session.refer(still(1e9 + now[0] + 0.1))
    assert len(line.stretches) == 1
    assert session.operate("stop").done
    assert line.wanted.name == "OFF"


def test_an_arming_is_answered_once_the_rig_has_confirmed_it(fieldbus):
    now = [0.0]
    line = open_link(fieldbus, VALUES, Clocks(lambda: (now[0], 1e9 + now[0])))
    bridge = Bridge(Limits(), 0.5, 0.0)
    session = RigSession(bridge, line, line.clocks.read, lambda news: None, lambda error: None)
    commands = OperatorCommands(lambda: session)
    session._look()
    waiting = commands.carry_out_confirmed("arm")
    assert waiting.send(None) is None  # it lets others do something: the rig knows nothing yet
    now[0] += 0.01
    session._look()
    with pytest.raises(StopIteration) as ended:
        waiting.send(None)
    assert ended.value.value.done
    assert session.figures()["state"] == "armed"


@pytest.mark.parametrize(("taken", "words"), [(0.0, ""), (0.04, "whose host had just taken 40 ms")])
def test_a_pause_is_noted_with_what_the_host_of_a_virtual_machine_took(
    fieldbus, monkeypatch, taken, words
):
    now, host = [0.0], [7.0]
    monkeypatch.setattr(rig_session, "time_taken_by_host", lambda: host[0])
    line = open_link(fieldbus, VALUES, Clocks(lambda: (now[0], 1e9 + now[0])))
    told = []
    bridge = Bridge(Limits(), 0.5, 0.0)
    session = RigSession(bridge, line, line.clocks.read, told.append, lambda error: None)
    session._look()
    now[0] += 0.01
    session._look()
    now[0] += 0.08
    host[0] += taken
    session._look()
    assert session.longest_pause == pytest.approx(0.08)
    notes = [note for _ in range(session._news.qsize()) for note in session._news.get().notes]
    (note,) = [note for note in notes if "kept the driver from the line for 80 ms" in note]
    assert words in note
    assert ("virtual machine" in note) is bool(words)


def test_a_stop_that_finds_the_driver_hanging_cuts_the_line_until_the_fault_is_reset(fieldbus):
    now = [0.0]
    line = open_link(fieldbus, VALUES, Clocks(lambda: (now[0], 1e9 + now[0])))
    bridge = Bridge(Limits(), 0.5, 0.0)
    session = RigSession(bridge, line, line.clocks.read, lambda news: None, lambda error: None)

    def pass_time():
        for _ in range(5):
            now[0] += 0.01
            session._look()

    session._look()
    assert session.operate("arm").done
    pass_time()
    assert bridge.states.confirmed
    with session._busy:  # held by a thread that hangs
        assert "has cut the line" in session.operate("stop").sentence
        assert not session.operate("reset_fault").done
    assert line.silent
    pass_time()
    assert state_text(bridge.states.state, bridge.states.reason) == f"fault: {LINE_CUT_REASON}"
    assert not session.operate("arm").done
    assert line.silent
    assert session.operate("reset_fault").done
    assert not line.silent
    pass_time()
    assert session.operate("arm").done
    pass_time()
    assert line.wanted.name == "HOLD"
    assert bridge.states.confirmed


def test_a_line_of_packets_sends_again_after_a_reset():
    """The line to an emulated rig, as every line that has a sender."""
    line = open_link("emulated", VALUES, Clocks(lambda: (time.monotonic(), time.time())))
    order = Order(Wanted.OFF, 0, Purpose.HEARTBEAT)
    sent = []
    line.line.send = sent.append
    try:
        line.silence()
        line.send(order)
        assert not sent
        line.speak()
        line.send(order)
        assert len(sent) == 1
    finally:
        line.close()


def test_without_a_session_a_stop_is_granted_and_all_else_refused():
    commands = OperatorCommands(lambda: None)
    assert commands.carry_out("stop").done
    answer = commands.carry_out("arm")
    assert not answer.done
    assert "not configured" in answer.sentence
    with pytest.raises(StopIteration) as ended:
        commands.carry_out_confirmed("start").send(None)
    assert not ended.value.value.done


def test_values_of_parameters_reach_the_bridge(fieldbus):
    values = {**VALUES, "link": fieldbus, "soft_start": 3.5, "operator_timeout": 1.25}
    session = open_session(values, "torque", lambda: 1e9, lambda news: None, print)
    assert session.bridge.soft_start == 3.5
    assert session.bridge.operator_timeout == 1.25
    assert state_text(session.bridge.states.state, session.bridge.states.reason) == "fault: torque"
    adjustment({**values, "soft_start": 1.5})(session.bridge)
    assert session.bridge.soft_start == 1.5


def test_an_unknown_line_is_refused_with_those_that_there_are():
    with pytest.raises(ValueError, match=r"'link' = 'nowhere' is refused; .*emulated.*udp"):
        open_link("nowhere", VALUES, Clocks(lambda: (0.0, 0.0)))


@pytest.mark.parametrize("name", link_names())
def test_every_line_has_all_that_the_driver_calls(name):
    kind = link_class(name)
    assert issubclass(kind, RigLink)
    assert not inspect.isabstract(kind), sorted(kind.__abstractmethods__)
    for method, declared in inspect.getmembers(RigLink, inspect.isfunction):
        own = inspect.signature(getattr(kind, method))
        assert list(own.parameters) == list(inspect.signature(declared).parameters), method


def test_the_driver_needs_neither_the_simulator_nor_a_compiler():
    program = """
import sys
BLOCKED = ("rig_emulator", "ankle_sim", "ankle_physics", "numba", "scipy", "mujoco")
class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in BLOCKED:
            raise ImportError(f"{name} is not on a rig's computer")
sys.meta_path.insert(0, Blocker())
import ankle_actuator_driver.ankle_actuator_driver_node
import ankle_actuator_driver.link.udp
import ankle_actuator_driver.link.protocol.heartbeat_process
"""
    found = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=False
    )
    assert found.returncode == 0, found.stderr


def test_the_safety_knows_no_packets():
    program = """
import sys, pkgutil, importlib
import ankle_actuator_driver.safety as safety
for module in pkgutil.iter_modules(safety.__path__):
    importlib.import_module(f"ankle_actuator_driver.safety.{module.name}")
print([name for name in sys.modules if name.startswith("ankle_actuator_driver.link")])
"""
    found = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=True
    )
    assert found.stdout.strip() == "[]"


def bring_up(session, clocks):
    """Reset, arm and start."""
    states, deadline = session.bridge.states, time.monotonic() + 60.0
    commands = {"fault": "reset_fault", "ready": "arm", "armed": "start"}
    while states.state.value != "running":
        assert time.monotonic() < deadline, states.reason
        session.refer(still(clocks()[1] + 0.1))
        if states.state.value in commands:
            session.operate(commands[states.state.value])
        time.sleep(0.02)


def move(session, clocks):
    """A sine of 10 mrad and 2 Hz for a second, as long as the rig runs."""
    first = clocks()[1] + 0.3
    for count in range(64):
        if session.bridge.states.state.value != "running":
            return
        at = first + (32 * count + np.arange(32)) / 2048
        phase = 2 * np.pi * 2.0 * (at - first)
        sine = np.column_stack([np.sin(phase), np.cos(phase), -np.sin(phase)])
        session.refer(np.column_stack([at, sine * 0.01 * np.array([1.0, 12.566, 157.9])]))
        time.sleep(max(0.0, at[-1] - 0.3 - clocks()[1]))


@pytest.mark.live
def test_the_emulated_rig_within_the_process_moves():
    reported = []
    started = time.monotonic()

    def clocks():
        now = time.monotonic()
        return now, 1e9 + now - started

    bridge = Bridge(Limits(), 0.3, 0.0)
    line = open_link("emulated", VALUES, Clocks(clocks))
    session = RigSession(bridge, line, clocks, lambda news: reported.extend(news.blocks), print)
    session.begin()
    try:
        # A machine that keeps this process waiting for 100 ms stops the rig: tried again.
        for _ in range(10):
            bring_up(session, clocks)
            reported.clear()
            move(session, clocks)
            if bridge.states.state.value == "running":
                break
        assert bridge.states.state.value == "running", bridge.states.reason
        assert np.ptp(np.concatenate(reported)[:, 1]) > 0.015
        assert session.operate("stop").done
    finally:
        session.end()
        session.close()
    assert bridge.states.state.value == "ready"
