"""The node as a process of its own, over DDS: pages, session events, a crash in the middle, refusal
to be open to strangers.
"""

import asyncio
import json
import re
import signal
import subprocess
import sys
import threading
import time

import aiohttp
import numpy as np
import pytest
import rclpy
from laboratory import short_protocol, until
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from ankle_interfaces.block import Block, pack
from ankle_node.node import BLOCK_QOS
from ankle_node.session_event import parse
from impedance_estimator.estimator import ESTIMATE_COLUMNS

pytestmark = [pytest.mark.live, pytest.mark.untimed]

PATIENCE = 90.0
RATE = 2048.0


def start(tmp_path, **parameters):
    program = "import sys; from biofeedback.biofeedback_node import main; sys.exit(main())"
    arguments = [sys.executable, "-c", program, "--ros-args"]
    for name, value in {"port": 0, "state_file": tmp_path / "state.json", **parameters}.items():
        arguments += ["-p", f"{name}:={value}"]
    return subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


class Graph:
    """What the node hears: samples and estimates at real time, and a rig's services.

    Keeps its session events.
    """

    def __init__(self, name="test_rig"):
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node(name, context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.events, self.called = [], []
        self.node.create_subscription(
            String, "/session/event", lambda message: self.events.append(parse(message.data)), 100
        )
        self.services = {
            action: self.node.create_service(
                Trigger,
                f"/{name}/{action}",
                lambda request, answer, action=action: self.answer(action, answer),
            )
            for action in ("arm", "start", "stop", "reset_fault")
        }
        self.samples = self.node.create_publisher(Float64MultiArray, "/ankle/samples", BLOCK_QOS)
        self.estimates = self.node.create_publisher(
            Float64MultiArray, "/impedance/estimate", BLOCK_QOS
        )
        self.stopped = threading.Event()
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def lose(self, action):
        """Take a service away, in the thread that serves it."""
        service = self.services.pop(action)
        self.executor.create_task(lambda: self.node.destroy_service(service))

    def answer(self, action, answer):
        self.called.append(action)
        answer.success, answer.message = True, ""
        return answer

    def run(self):
        began, sent = time.time(), 0
        while not self.stopped.is_set():
            self.executor.spin_once(timeout_sec=1 / 64)
            count = int((time.time() - began) * RATE) - sent
            t = began + (sent + np.arange(count)) / RATE
            sent += count
            if count:
                self.samples.publish(
                    pack(
                        Block(
                            ("t[s]", "position[rad]", "velocity[rad/s]", "torque[N.m]"),
                            np.column_stack([t, *np.zeros((3, count))]),
                        )
                    )
                )
                row = np.zeros((1, len(ESTIMATE_COLUMNS)))
                row[0, [0, 1, 4, 7]] = t[-1], 80.0, 8.0, 1.0
                self.estimates.publish(pack(Block(ESTIMATE_COLUMNS, row)))

    def close(self):
        self.stopped.set()
        self.thread.join(10.0)
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


@pytest.fixture
def graph():
    made = Graph()
    yield made
    made.close()


def port_of(process):
    """The port that the node prints, and its output from then on is drained."""
    for line in process.stdout:
        if found := re.search(r"http://127\.0\.0\.1:(\d+)/", line):
            threading.Thread(target=lambda: [None for _ in process.stdout], daemon=True).start()
            return int(found[1])
    raise AssertionError("the node ended without serving")


class OpenPage:
    """An operator's page that stays open, and comes back as a browser's does."""

    def __init__(self, port):
        self.port, self.closing = port, threading.Event()
        self.thread = threading.Thread(target=lambda: asyncio.run(self.stay()))
        self.thread.start()

    async def stay(self):
        async with aiohttp.ClientSession() as session:
            while not self.closing.is_set():
                try:
                    await self.read(session)
                except (aiohttp.ClientError, ConnectionError):
                    await asyncio.sleep(0.2)

    async def read(self, session):
        async with session.ws_connect(f"http://127.0.0.1:{self.port}/ws?role=operator") as page:
            async for message in page:
                if self.closing.is_set():
                    return
                if json.loads(message.data)["type"] == "frame":
                    await page.send_str("seen")

    def close(self):
        self.closing.set()
        self.thread.join(10.0)


def say(port, *commands):
    """Send commands one after the other as an operator's page; gives the last state."""
    commands = ["claim", *commands] if set(commands) - {"stop"} else commands

    async def scenario():
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(f"http://127.0.0.1:{port}/ws?role=operator") as page,
        ):
            state = None
            for number, name in enumerate([*commands, "note"]):
                extra = {"text": "seen"} if name == "note" else {}
                await page.send_json({"id": number, "command": name, **extra})
                answered = False
                while not answered or state is None:
                    message = json.loads((await page.receive(PATIENCE)).data)
                    if message["type"] == "frame":
                        await page.send_str("seen")
                    answered = answered or (message["type"] == "answer" and message["id"] == number)
                    if message["type"] == "answer":
                        assert message["ok"], message
                    state = message if message["type"] == "state" else state
            return state

    return asyncio.run(asyncio.wait_for(scenario(), PATIENCE))


def named(graph, name):
    return [event for event in graph.events if event.event == name]


def test_a_session_survives_a_crash_of_the_node_in_the_middle(graph, tmp_path):
    short_protocol(tmp_path, baseline=1, reach=1, hold=90)
    process = start(tmp_path, protocol=tmp_path / "short.yaml")
    page = None
    try:
        port = port_of(process)
        page = OpenPage(port)
        until(lambda: say(port)["rig"]["name"] == "test_rig", "the rig is found", PATIENCE)
        say(port, "arm", "start")
        until(lambda: named(graph, "hold started"), "a hold", PATIENCE)
        assert graph.called == ["arm", "start"]
        time.sleep(2.0)
        process.kill()
        process.wait(PATIENCE)
        process = start(tmp_path, protocol=tmp_path / "short.yaml", port=port)
        assert port_of(process) == port
        until(lambda: len(named(graph, "hold started")) == 2, "the same hold again", PATIENCE)
        ended = named(graph, "hold ended")[0]
        assert ended.details["broken_off"] == "screen restarted"
        assert [event.details["hold"] for event in named(graph, "hold started")] == [1, 1]
        assert len(named(graph, "baseline measured")) == 1  # the axes are those from before
        # Its driver reports no state, so the session cannot tell that it should stop.
        assert graph.called == ["arm", "start"]
        say(port, "stop")
        until(lambda: say(port)["session"]["state"] == "idle", "the session stops", PATIENCE)
        assert round(say(port)["baseline"]["K"]) == 80
        until(lambda: graph.called[-1] == "stop", "the rig is stopped", PATIENCE)
    finally:
        if page is not None:
            page.close()
        process.send_signal(signal.SIGINT)
        try:
            process.wait(20.0)
        finally:
            process.kill()


def test_a_stop_said_before_the_rig_is_found_reaches_it(tmp_path):
    process = start(tmp_path)
    made = None
    try:
        say(port_of(process), "stop")
        made = Graph()
        until(lambda: "stop" in made.called, "the rig is stopped", PATIENCE)
        count = len(made.called)
        time.sleep(2.5)  # confirmed, so it is not repeated
        assert len(made.called) == count
    finally:
        process.kill()
        if made is not None:
            made.close()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_node_that_is_ended_stops_the_rig_first(graph, tmp_path, number):
    short_protocol(tmp_path, baseline=60)
    process = start(tmp_path, protocol=tmp_path / "short.yaml")
    page = None
    try:
        port = port_of(process)
        page = OpenPage(port)
        until(lambda: say(port)["rig"]["name"] == "test_rig", "the rig is found", PATIENCE)
        say(port, "arm", "start")
        process.send_signal(number)
        until(lambda: graph.called == ["arm", "start", "stop"], "the rig is stopped", PATIENCE)
        assert process.wait(20.0) == 0
    finally:
        if page is not None:
            page.close()
        process.kill()


def test_a_stop_reaches_every_driver_also_one_that_lost_a_service(graph, tmp_path):
    """Discovery no longer sees `start` of one driver, and a second driver has appeared."""
    process = start(tmp_path)
    other = None
    try:
        port = port_of(process)
        until(lambda: say(port)["rig"]["name"] == "test_rig", "the rig is found", PATIENCE)
        graph.lose("start")
        until(
            lambda: "does not offer start" in say(port)["rig"]["problem"],
            "the lost service is named",
            PATIENCE,
        )
        say(port, "stop")
        until(lambda: graph.called == ["stop"], "the rig is stopped", PATIENCE)
        other = Graph("second_rig")
        until(
            lambda: (
                "2 rig drivers are in this graph (second_rig, test_rig)"
                in say(port)["rig"]["problem"]
            ),
            "two drivers are named",
            PATIENCE,
        )
        until(lambda: named(graph, "fault"), "the fault is recorded", PATIENCE)
        say(port, "stop")
        for one in (graph, other):
            until(lambda one=one: one.called[-1:] == ["stop"], "every rig is stopped", PATIENCE)
    finally:
        process.kill()
        process.wait(20.0)
        if other is not None:
            other.close()


def test_the_token_is_in_a_private_file_and_in_no_log(tmp_path):
    token = "0123456789-secret-of-the-laboratory"
    process = start(tmp_path, host="0.0.0.0", token=token)
    try:
        lines = []
        for line in process.stdout:
            lines.append(line)
            if "the addresses with their tokens are in" in line:
                break
        links = tmp_path / "state.json.links"
        assert links.stat().st_mode & 0o077 == 0
        assert "operator: http://0.0.0.0 (or this computer's name):" in links.read_text()
        assert token in links.read_text()
        process.send_signal(signal.SIGINT)
        lines += process.communicate(timeout=20.0)[0].splitlines()
        assert not [line for line in lines if token in line]
    finally:
        process.kill()
        process.wait(20.0)


def test_a_session_of_yesterday_is_not_gone_on_with(tmp_path):
    short_protocol(tmp_path)
    saved = {"protocol": "x", "state": "running", "index": 2, "saved_at[s]": time.time() - 90_000.0}
    (tmp_path / "state.json").write_text(json.dumps(saved))
    process = start(tmp_path, protocol=tmp_path / "short.yaml")
    try:
        assert say(port_of(process))["session"]["state"] == "idle"
    finally:
        process.kill()
        process.wait(20.0)
