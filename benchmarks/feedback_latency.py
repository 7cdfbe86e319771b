"""How late the subject's screen is, and how smooth, with every node on this computer and a real
Chromium.

    .venv/bin/python benchmarks/feedback_latency.py

Latency: the simulated reflex gain G steps between 5 and 15 N.m.s/rad. For each step and each level
between, the time at which an estimate crosses the level (the time of the last sample that the
estimate is made from) is compared with the time at which the cursor's pixels, read back from the
canvas, cross the same level. So transport, estimator's computing, frame rate, cursor and drawing
all count; the estimator's own rise does not. Not in it: the display's own refresh, half a frame of
60 Hz on average.

Frame rate: new frames drawn by the subject's page in each second, while a recorder, the EMG
processing and an operator's page with all traces run as well.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import yaml
from stop_latency import Commander

from ankle_bringup.browser_pages import free_port, wait_until_served
from ankle_bringup.graph import Graph, load_graph
from ankle_bringup.processes import Processes
from ankle_interfaces.block import unpack
from ankle_node.domain import stay_on_this_host, take_free_domain
from biofeedback.web.system_browser import ARGUMENTS, NO_BROWSER, find_browser
from session_recorder.bag_reader import BagReader

LEVELS = (0.2, 0.35, 0.5, 0.65, 0.8)  # parts of the step
STEP, FIRST_STEP_TIME, SPACING, STEPS = (5.0, 15.0), 60.0, 20.0, 8  # N.m.s/rad, s
LIMIT = 100.0  # ms beyond the estimator's rise
LEAST_RATE = 25.0  # Hz
# s: longest wait for a session that runs, how long it must run, and between two commands.
PATIENCE, SETTLING_TIME, LOOK_PERIOD = 60.0, 3.0, 0.5
PROTOCOL = {
    "baseline[s]": 600,
    "reach[s]": 1,
    "hold[s]": 1,
    "break[s]": 0,
    "torque_half_width[N.m]": 1,
    "level_half_width[1]": 0.1,
    "blocks": [{"feedback": "G", "holds": [{"torque_target[N.m]": 0, "level[1]": 1}]}],
}
# The cursor's centre is the middle of its colour in the row through it.
WATCH_SCRIPT = """() => {
  const canvas = document.getElementById('screen'), context = canvas.getContext('2d');
  window.seen = []; window.drawn = []; window.ways = [];
  let last = '';
  const look = () => {
    const { frame, y, quality, made } = canvas.dataset;
    if (frame !== last) {
      last = frame;
      const now = performance.timeOrigin + performance.now();
      window.drawn.push(now);
      window.ways.push(Date.now() - 1e3 * made);
      const row = context.getImageData(0, Math.round(+y) + 8, canvas.width, 1).data;
      let sum = 0, count = 0;
      for (let x = 0; x < canvas.width; x++) {
        const near = (colour) => colour.every((value, k) => Math.abs(value - row[4 * x + k]) < 8);
        if (near([230, 159, 0]) || near([0, 179, 132])) { sum += x; count++; }
      }
      if (count && quality === 'valid') window.seen.push([now, sum / count + 0.5]);
    }
    requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
  const [left, , wide] = canvas.dataset.plot.split(' ').map(Number);
  return [left, wide, performance.timeOrigin + performance.now() - Date.now()];
}"""


async def set_going(commander: Commander) -> None:
    """Arm and start by the page's own commands, until the session goes on by itself.

    A session that is armed before its rig is known stops when the rig appears.
    """
    deadline, running = time.monotonic() + PATIENCE, 0.0
    while running < SETTLING_TIME:
        if time.monotonic() > deadline:
            raise SystemExit(
                f"the session is {commander.state} after {PATIENCE:g} s: {commander.refusal}"
            )
        wanted = {"idle": "arm", "paused": "arm", "armed": "start"}.get(commander.state)
        if wanted:
            commander.command(wanted)
        await asyncio.sleep(LOOK_PERIOD)
        running = running + LOOK_PERIOD if commander.state == "running" else 0.0


async def watch(port: int, seconds: float) -> dict:
    """Run the session with an operator's and a subject's page open, and give what the subject's
    page showed.
    """
    from playwright.async_api import async_playwright

    path = find_browser()
    if path is None:
        raise SystemExit(NO_BROWSER)
    url = f"http://127.0.0.1:{port}"
    async with async_playwright() as driver:
        browser = await driver.chromium.launch(executable_path=path, args=list(ARGUMENTS))
        operator = await browser.new_page(viewport={"width": 1600, "height": 950})
        await operator.goto(f"{url}/operator")
        subject = await browser.new_page(viewport={"width": 1280, "height": 720})
        await subject.goto(f"{url}/")
        await set_going(Commander(url))
        left, wide, offset = await subject.evaluate(WATCH_SCRIPT)
        began = time.monotonic()
        while (remaining := seconds - (time.monotonic() - began)) > 0:
            await asyncio.sleep(min(remaining, 10.0))
            print(
                f"{time.monotonic() - began:5.0f} s of {seconds:.0f}, load "
                f"{os.getloadavg()[0]:.1f}",
                file=sys.stderr,
                flush=True,
            )
        seen, drawn, ways = await subject.evaluate("[window.seen, window.drawn, window.ways]")
        await browser.close()
    seen = np.array(seen).reshape(-1, 2)
    # The browser's clock is monotonic from its start; the difference to the system's clock is taken
    # out.
    return {
        "time": (seen[:, 0] - offset) / 1e3,
        "G": 20.0 * (seen[:, 1] - left) / wide,
        "drawn": (np.array(drawn) - offset) / 1e3,
        "way": np.array(ways),
    }


def run(graph: Graph, folder: Path, settings: list[str], seconds: float) -> tuple[dict, BagReader]:
    """Run a graph with both pages; gives what was drawn, and the bag."""
    port = free_port()
    protocol = folder / "protocol.yaml"
    protocol.write_text(yaml.safe_dump(PROTOCOL))
    common = [
        f"record.out={folder / 'bag'}",
        f"biofeedback.port={port}",
        f"biofeedback.state_file={folder / 'progress.json'}",
    ]
    common += [f"biofeedback.protocol={protocol}"]
    with Processes(graph.with_settings([*common, *settings]), folder / "logs") as processes:
        wait_until_served(port, processes)
        shown = asyncio.run(watch(port, seconds))
        processes.stop()
    return shown, BagReader(folder / "bag")


def crossing(
    time: np.ndarray, value: np.ndarray, after: float, level: float, rising: bool
) -> float:
    """Return the first time after `after` with a value beyond a level; NaN without one."""
    beyond = (value >= level) if rising else (value <= level)
    found = np.flatnonzero(beyond & (time > after) & (time < after + SPACING - 1.0))
    return float(time[found[0]]) if len(found) else float("nan")


def latencies(shown: dict, bag: BagReader) -> tuple[np.ndarray, np.ndarray]:
    """Pixel less estimate, and arrival of that estimate at the recorder less estimate [ms], shape
    (steps, levels) each.
    """
    blocks = [
        (stamp, unpack(message)) for _, stamp, message in bag.messages(["/impedance/estimate"])
    ]
    columns = blocks[0][1].columns
    rows = np.array(
        [
            [
                *block.data[-1, [0, columns.index("G[N.m.s/rad]"), columns.index("valid[1]")]],
                stamp / 1e9,
            ]
            for stamp, block in blocks
        ]
    )
    rows = rows[rows[:, 2] == 1.0]
    truth_columns, truth = bag.signal("/ankle/truth")
    G = truth[:, truth_columns.index("G[N.m.s/rad]")]
    pixels, arrivals = [], []
    for index in np.flatnonzero(np.abs(np.diff(G)) > 1.0):
        at, rising = truth[index, 0], bool(G[index + 1] > G[index])
        levels = [G[index] + part * (G[index + 1] - G[index]) for part in LEVELS]
        pixel = np.array(
            [crossing(shown["time"], shown["G"], at, level, rising) for level in levels]
        )
        estimate = np.array(
            [crossing(rows[:, 0], rows[:, 1], at, level, rising) for level in levels]
        )
        arrived = np.array(
            [
                rows[np.searchsorted(rows[:, 0], t), 3] if np.isfinite(t) else np.nan
                for t in estimate
            ]
        )
        pixels.append(1e3 * (pixel - estimate))
        arrivals.append(1e3 * (arrived - estimate))
    return np.array(pixels), np.array(arrivals)


def main() -> int:
    """Run, print a table, exit with 1 where a limit is not kept."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument(
        "--rate-seconds", type=float, default=60.0, help="length of the frame rate's run"
    )
    rate_seconds = options.parse_args().rate_seconds
    take_free_domain()
    stay_on_this_host()
    graph = load_graph("simulated_session")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        changes = [{"at[s]": 0, "reflex.G[N.m.s/rad]": STEP[0]}]
        changes += [
            {"at[s]": FIRST_STEP_TIME + k * SPACING, "reflex.G[N.m.s/rad]": STEP[(k + 1) % 2]}
            for k in range(STEPS)
        ]
        scenario = folder / "steps.yaml"
        scenario.write_text(yaml.safe_dump({"scenario": "steps of G", "changes": changes}))
        (folder / "steps").mkdir()
        (folder / "rate").mkdir()
        load = [os.getloadavg()[0]]
        steps, bag = run(
            graph,
            folder / "steps",
            ["ankle_sim.subject=0", f"ankle_sim.scenario={scenario}"],
            FIRST_STEP_TIME + STEPS * SPACING,
        )
        late, arrived = latencies(steps, bag)
        load.append(os.getloadavg()[0])
        smooth, _ = run(graph, folder / "rate", [], rate_seconds)
        load.append(os.getloadavg()[0])
    drawn = smooth["drawn"]
    rates = np.array(
        [
            np.count_nonzero((drawn >= t) & (drawn < t + 1.0))
            for t in np.arange(drawn[0] + 2.0, drawn[-1] - 1.0)
        ]
    )
    known = late[np.isfinite(late)]
    print(
        f"steps of G found on the screen          {len(late)} of {STEPS}, {np.isnan(late).sum()} "
        f"of {late.size} levels not reached"
    )
    print(
        f"latency, estimate to pixel              median {np.median(known):.0f} ms, worst "
        f"{known.max():.0f} ms (limit {LIMIT:g} ms)"
    )
    there = arrived[np.isfinite(arrived)]
    print(
        f"peer: the same estimate at the recorder  median {np.median(there):.0f} ms, worst "
        f"{there.max():.0f} ms"
    )
    print(
        f"of it, frame made to frame in the canvas median {np.median(steps['way']):.0f} ms, worst "
        f"{steps['way'].max():.0f} ms"
    )
    for part, column in zip(LEVELS, late.T, strict=True):
        column = column[np.isfinite(column)]
        print(
            f"  at {100 * part:.0f} % of the step                        median "
            f"{np.median(column):.0f} ms, worst {column.max():.0f} ms"
        )
    print(
        f"frames drawn in a second                median {np.median(rates):.0f}, least "
        f"{rates.min()} (limit {LEAST_RATE:g})"
    )
    print(f"load average before, between, after     {', '.join(f'{value:.1f}' for value in load)}")
    return 0 if np.median(known) <= LIMIT and np.median(rates) >= LEAST_RATE else 1


if __name__ == "__main__":
    sys.exit(main())
