"""How long it takes from a key on a page to the plate at rest, beside a busy disk and processor.

    .venv/bin/python benchmarks/stop_latency.py --stops 200 --load

The rig graph runs with its emulator (multisine, 0.04 rad), recorder included, without the
estimator, which no stop passes through, and both pages in a real Chromium. The
key is Space, pressed in the browser in turn on the operator's page and on the subject's; the effect
is read from the rig's own samples. In it are: the browser's key event, the WebSocket, the pages'
server, the call over DDS, the driver, the UDP line, the servo cycle, the stop movement and the
30 Hz servo. With ``--load`` two processes compute without a pause, and one writes and flushes 4 MB
files. ``--without-browser`` stands for a page on another computer: this process sends the page's
message, with the priority of the pages' server.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import aiohttp
import numpy as np
import rclpy
from playwright.sync_api import sync_playwright
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rig import OBSERVATION_TIME, REST_VELOCITY, Operator, line

from ankle_bringup.browser_pages import free_port, wait_until_served
from ankle_bringup.graph import Graph, load_graph
from ankle_bringup.live_graph import observer
from ankle_bringup.processes import Processes
from ankle_bringup.up import ending_by_signal
from ankle_node.domain import take_free_domain
from ankle_node.real_time import PAGES_PRIORITY, take_priority
from biofeedback.web.server import FRAME_ANSWER
from biofeedback.web.system_browser import ARGUMENTS, NO_BROWSER, find_browser

BUSY_LOOP = "while True: sum(range(10**6))"
WRITE = """
import os, sys
while True:
    with open(sys.argv[1], "wb") as stream:
        stream.write(os.urandom(4_000_000))
        stream.flush()
        os.fsync(stream.fileno())
"""
PATIENCE = 60.0
MOTION_WINDOW = 0.3  # s; the perturbation does not rest for so long


class Listener(Operator):
    """Hears the rig in a thread of its own: every message, however many there are."""

    def __init__(self, node: rclpy.node.Node) -> None:
        super().__init__(node)
        executor = SingleThreadedExecutor()
        executor.add_node(node)

        def hear() -> None:
            with contextlib.suppress(ExternalShutdownException):
                executor.spin()

        threading.Thread(target=hear, daemon=True).start()

    def spin(self, seconds: float) -> None:
        """Wait."""
        time.sleep(seconds)


class Commander:
    """An operator's page without a browser, that takes command, arms and starts."""

    def __init__(self, url: str) -> None:
        self._loop = asyncio.new_event_loop()
        self._wanted: asyncio.Queue[str] = asyncio.Queue()
        self.state = self.refusal = ""
        threading.Thread(target=self._run, args=(url,), daemon=True).start()

    def _run(self, url: str) -> None:
        self._loop.run_until_complete(self._talk(url))

    async def _talk(self, url: str) -> None:
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(f"{url}/ws?role=operator", max_msg_size=0) as page,
        ):
            await page.send_json({"id": 0, "command": "claim"})
            sending = asyncio.create_task(self._send(page))
            async for message in page:
                content = json.loads(message.data)
                if content["type"] == "frame":
                    await page.send_str(FRAME_ANSWER)
                if content["type"] == "state":
                    self.state = content["session"]["state"]
                if content["type"] == "answer" and not content["ok"]:
                    self.refusal = content["error"]
            sending.cancel()
            self.state, self.refusal = "", f"the node closed the page ({page.close_code})"

    async def _send(self, page: aiohttp.ClientWebSocketResponse) -> None:
        number = 0
        while True:
            number += 1
            await page.send_json({"id": number, "command": await self._wanted.get()})

    def command(self, name: str) -> None:
        """Send a command."""
        self._loop.call_soon_threadsafe(self._wanted.put_nowait, name)


def run_again(rig: Operator, commander: Commander) -> None:
    """Until session and rig run, by the pages' own commands."""
    deadline = time.monotonic() + PATIENCE
    asked = 0.0
    while not (rig.states and rig.states[-1][0] == "running" and commander.state == "running"):
        if time.monotonic() > deadline:
            raise SystemExit(
                f"rig {rig.states[-1:]}, session {commander.state}: it does not run; last refusal: "
                f"{commander.refusal}"
            )
        if time.monotonic() - asked > 0.5:
            asked = time.monotonic()
            fault = rig.states and rig.states[-1][0] == "fault"
            wanted = {"idle": "arm", "paused": "arm", "armed": "start"}.get(commander.state)
            if fault:
                commander.command("reset_fault")
            elif wanted:
                commander.command(wanted)
        rig.spin(0.02)
    rig.spin(1.5)  # beyond the soft start


def press_and_measure(rig: Operator, press: Callable[[], None]) -> float | None:
    """Seconds from the key to the plate's last motion; None where the plate did not move before."""
    if rig.states[-1][0] != "running":
        return None
    pressed = time.time()
    press()
    deadline = time.monotonic() + PATIENCE
    while (
        rig.blocks[-1][-1, 0] < pressed + OBSERVATION_TIME
    ):  # of the rig's time: a reader may be late
        if time.monotonic() > deadline:
            return None
        rig.spin(0.05)
    data = np.concatenate(rig.blocks[-200:])
    before = data[(data[:, 0] > pressed - MOTION_WINDOW) & (data[:, 0] <= pressed), 2]
    if not len(before) or np.abs(before).max() <= REST_VELOCITY:
        return None
    moving = data[(np.abs(data[:, 2]) > REST_VELOCITY) & (data[:, 0] > pressed), 0]
    return float(moving.max()) - pressed if len(moving) else 0.0


def main() -> int:
    """Run and print."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--stops", type=int, default=50)
    options.add_argument(
        "--without-browser", action="store_true", help="from the message of a page without Chromium"
    )
    options.add_argument("--load", action="store_true", help="keep disk and processor busy")
    given = options.parse_args()
    path = find_browser()
    if path is None and not given.without_browser:
        raise SystemExit(NO_BROWSER)
    take_free_domain()
    port = free_port()
    burden: list[subprocess.Popen] = []
    found: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        graph = load_graph("rig").with_options(["emulator"])
        graph = graph.with_settings(
            [
                "perturbation_generator.signal=multisine",
                "rig_emulator.noise=false",  # its velocity noise would count as motion
                "perturbation_generator.wait_for_readers=2",
                "ankle_actuator_driver.wait_for_readers=2",
                f"biofeedback.port={port}",
                f"record.out={folder}/bag",
                f"biofeedback.state_file={folder}/progress.json",
            ]
        )
        graph = Graph(
            graph.description,
            tuple(node for node in graph.nodes if node.name != "impedance_estimator"),
        )
        with (
            ending_by_signal(),
            observer("benchmark", own_signals=True) as node,
            Processes(graph, Path(folder) / "logs") as processes,
            sync_playwright() as driver,
        ):
            wait_until_served(port, processes)
            url = f"http://127.0.0.1:{port}"
            pages = []
            if not given.without_browser:
                browser = driver.chromium.launch(executable_path=path, args=list(ARGUMENTS))
                pages = [browser.new_page() for _ in range(2)]
            for page, where in zip(pages, ("/operator", "/"), strict=False):
                page.goto(url + where)
            rig, commander = Listener(node), Commander(url)
            try:
                if given.load:
                    work = [[sys.executable, "-c", BUSY_LOOP]] * 2
                    work.append([sys.executable, "-c", WRITE, f"{folder}/busy"])
                    burden = [subprocess.Popen(one, start_new_session=True) for one in work]
                if given.without_browser:  # now, because a child inherits the priority
                    take_priority(PAGES_PRIORITY)
                while len(found) < given.stops:
                    run_again(rig, commander)
                    if pages:
                        page = pages[len(found) % 2]
                        page.bring_to_front()
                        rig.spin(0.3)
                        press = partial(page.keyboard.press, " ")
                    else:
                        press = partial(commander.command, "stop")
                    seconds = press_and_measure(rig, press)
                    if seconds is not None:
                        found.append(seconds)
                        print(
                            f"{len(found)} of {given.stops}: {1e3 * seconds:.0f} ms",
                            file=sys.stderr,
                        )
            finally:
                for process in burden:
                    process.kill()
                    process.wait()
                for page in pages:
                    page.close()
    load = os.getloadavg()[0]
    print(f"load average at the end: {load:.1f}; {len(found)} stops")
    begin = "stop of a page" if given.without_browser else "key on a page"
    print(line(f"{begin} to plate below {REST_VELOCITY:g} rad/s", np.array(found)))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
