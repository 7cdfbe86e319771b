"""The pages look as on their pictures in the documentation, at four widths.

The pages are the real ones in a real Chromium; what the node would send is written here, so that
nothing in a picture depends on the clock. With the environment variable ANKLE_SCREENSHOTS=docs the
pictures are taken anew instead of compared.
"""

import json
import os
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from test_layout import CANVAS_WORDS, CHECK
from test_pages import PATIENCE

from biofeedback.web import messages

pytestmark = [pytest.mark.live, pytest.mark.untimed]

DOCS = Path(__file__).resolve().parents[3] / "docs"
SIZES = ((1920, 1080), (1366, 768), (820, 1180), (390, 844))
CELL = 8
"""[pixels] Side of the cells that are compared: the edges of letters differ between computers, the
place of a word does not."""
CONTRAST = 0.08
"""Least difference of the mean brightness of two cells, from 0 to 1, that counts."""
TILE = 16
"""Side of a tile in cells: what moves is seen where it was and where it is, not in the mean of a
page."""
LARGEST_SHARE = 0.05
"""Largest share of the cells of a tile that may differ; a page taken twice has none."""
PROBE = """() => { const context = document.createElement('canvas').getContext('2d');
    context.font = getComputedStyle(document.body).font;
    return context.measureText('Hold it there, 0123456789').width; }"""
PROBE_WIDTH = 185.16
"""[pixels] Width of the probe in the letters of the pictures, DejaVu Sans."""
START = 1_795_000_000.0  # s; any time


def bins(levels, ripple, pulse=None):
    """Bins of traces about levels, by name, in which `pulse` is up for some of the time."""
    random = np.random.default_rng(1)
    up = np.repeat(random.random(BINS // 12 + 1) < 0.5, 12)[:BINS]
    found = {}
    for name, level in levels.items():
        middle = level + np.where(up, (pulse or {}).get(name, 0.0), 0.0)
        found[name] = middle + ripple * random.normal(size=(2, BINS))
    return messages.Bins(
        0,
        {name: np.round(rows.min(axis=0), 3).tolist() for name, rows in found.items()},
        {name: np.round(rows.max(axis=0), 3).tolist() for name, rows in found.items()},
    )


def check(name, title, state, result, in_motion=False):
    return messages.CheckState(
        name, title, "", not in_motion, False, False, in_motion, state, result
    )


STATE = messages.State(
    version=12,
    session=messages.SessionState(
        "running", "", "Session of van 't Veld et al. 2018", "hold", 2, 4, 7, 20, 60.0,
        [0.98, 0.71], 6, 5, "hold",
    ),
    target=messages.TargetState("G", "N.m.s/rad", -5.0, 1.0, 5.2, 7.0),
    axes=messages.Axes([0.0, 17.0], [-9.0, 4.0], []),
    baseline=messages.BaselineState(81.4, 7.62, -0.2),
    rig=messages.RigState("ankle_actuator_driver", "", "running", []),
    subject=messages.SubjectState(0.2, 0.6, 5.0),
    log=[
        messages.LogEntry(START - 300.0 + 60.0 * k, event, details)
        for k, (event, details) in enumerate(
            [
                ("session armed", {}),
                ("session started", {"block": 1}),
                ("baseline measured", {"K[N.m/rad]": 81.4, "G[N.m.s/rad]": 7.62}),
                ("hold started", {"hold": 7, "torque_target[N.m]": -5.0, "feedback": "G"}),
            ]
        )
    ],
    nodes=[
        messages.NodeState(name, "ok", message)
        for name, message in (
            ("ankle_actuator_driver", "running"),
            ("impedance_estimator", "simultaneous at 2048 Hz, velocity measured"),
            ("emg_processor", "running"),
            ("record", "recording"),
        )
    ],
    recording=messages.Recording(True, 48211, 0, 182000),
    reason="",
    doubt="",
    pages=messages.Pages(1, 1, True),
    language="en",
    checks=[
        check("zero", "Zero", "done", {"torque[N.m]": -0.2}),
        check("mvc_plantarflexion", "Maximal push", "done", {"torque[N.m]": -92.0}),
    ],
    trials=None,
    visit="S07, visit 3",
    body_mass=71.0,
)  # fmt: skip
FRAME = messages.Frame(
    n=900, now=30.0, t=29.98, x=6.3, y=-4.6, quality="valid", torque_quality="valid", age=0.02,
    K=82.1, G=6.3, torque=-4.6,
    in_target=True, hint="good", elapsed=24.0, remaining=36.0, clock=1044.0,
)  # fmt: skip
WIDTH = 0.05  # s of a bin
BINS = 600  # of 30 s
MUSCLES = {"SOL": 12.0, "TA": 5.0, "GL": 9.0, "GM": 10.0}  # standard deviations [µV]
EMG = [bins({name: 0.0}, size) for name, size in MUSCLES.items()]
TRACES = messages.TracesMessage(
    {
        "ankle": bins({"torque": 4.6, "angle": -1.1}, 0.05, {"torque": 3.1, "angle": 2.3}),
        "estimate": bins({"K": 82.0, "G": 6.3}, 0.1),
        "emg": messages.Bins(
            0,
            {name: values for one in EMG for name, values in one.low.items()},
            {name: values for one in EMG for name, values in one.high.items()},
        ),
    },
    dict.fromkeys(("ankle", "estimate", "emg"), WIDTH),
)
OF_RIG = replace(
    STATE,
    session=messages.SessionState(
        "finished", "", "Calibration of the rig", "rig_calibration", 1, 1, 0, 0, 132.0,
        [None, None], 0, 0, "finished",
    ),
    baseline=None,
    rig=messages.RigState("ankle_actuator_driver", "", "ready: stopped by the operator", []),
    subject=None,
    log=[
        messages.LogEntry(START - 150.0, "session armed", {}),
        messages.LogEntry(START - 147.0, "session started", {"block": 1}),
        messages.LogEntry(START, "session finished", {}),
    ],
    nodes=[STATE.nodes[0], messages.NodeState("perturbation_generator", "ok", "running")],
    recording=messages.Recording(False, None, None, None),
    checks=[
        check("no_foot_on_plate", "No foot on the plate", "done", {}),
        check(
            "calibrate_rig",
            "Rig calibration",
            "done",
            {
                "torque behind position": "0.491 ± 0.014 ms",
                "velocity behind position": "-0.000 ± 0.001 ms",
                "inertia of the plate": "0.0042 ± 8.3e-06 kg.m^2",
                "friction of the bearing": "0.301 ± 0.00056 N.m",
                "servo": "30.55 ± 0.67 Hz, damping 0.7034 ± 0.014",
                "zero of position": "0.00400 rad",
                "zero of torque": "-0.3094 N.m",
                "noise": "4.5e-05 rad, 0.14 N.m, 0.0065 rad/s",
                "torque explained": "99.80 % of what follows the plate",
                "mode of the torque sensor": "71.05 ± 0.033 Hz, damping 0.03025 ± 0.00056",
                "note": "how far the servo gives way was not found: the load was too small. Mount "
                "a spring of 50 to 200 N.m/rad and complete this file with it",
                "file": "/home/laboratory/rig.yaml",
            },
            in_motion=True,
        ),
    ],
    visit="",
    body_mass=None,
)  # fmt: skip
FROZEN_CLOCK = "performance.now = () => 1000;"


def answer_as_the_node(socket, state):
    """Take the node's place at the other end of a page's WebSocket."""
    socket.on_message(lambda text: None)
    groups = ("ankle",) if state is OF_RIG else TRACES.groups
    traces = replace(TRACES, groups={name: TRACES.groups[name] for name in groups})
    for message in (messages.Command(True), state, traces, FRAME):
        socket.send(json.dumps(asdict(message)))


@pytest.fixture
def open_still(browser, laboratory):
    """Return what opens a page whose contents stand still."""
    pages = []

    def open_one(path, width, height, state=STATE):
        page = browser.new_page(
            timezone_id="UTC",
            device_scale_factor=1,
            viewport={"width": width, "height": height},
        )
        page.set_default_timeout(PATIENCE)
        page.add_init_script(FROZEN_CLOCK)
        page.add_init_script(CANVAS_WORDS)
        page.route_web_socket("**/ws*", lambda socket: answer_as_the_node(socket, state))
        page.goto(laboratory.url(path))
        shown = {"hold": "Hold it there", "finished": "Finished"}[state.session.instruction]
        page.locator(".v-instruction", has_text=shown).wait_for(state="attached")
        pages.append(page)
        return page

    yield open_one
    for page in pages:
        page.close()


def take(page, path):
    """Take a picture once the page stands still: canvases are drawn after the layout."""
    before = b""
    for _ in range(40):
        page.wait_for_timeout(250)
        page.screenshot(path=path, full_page=True, animations="disabled")
        if path.read_bytes() == before:
            return path
        before = path.read_bytes()
    raise AssertionError("the page does not come to rest")


def cells(path):
    """Mean brightness of the cells of a picture, from 0 to 1."""
    brightness = imread(path)[..., :3].mean(axis=2)
    rows, columns = (size // CELL for size in brightness.shape)
    whole = brightness[: rows * CELL, : columns * CELL]
    return whole.reshape(rows, CELL, columns, CELL).mean(axis=(1, 3))


def difference(path, reference):
    """Largest share of the cells of a tile that differ in two pictures; 1 where their sizes do."""
    one, other = cells(path), cells(reference)
    if one.shape[1] != other.shape[1] or abs(one.shape[0] - other.shape[0]) > 2:
        return 1.0
    rows = min(len(one), len(other))
    differs = np.abs(one[:rows] - other[:rows]) > CONTRAST
    tiles = [
        differs[top : top + TILE, left : left + TILE].mean()
        for top in range(0, rows, TILE)
        for left in range(0, differs.shape[1], TILE)
    ]
    return float(max(tiles))


def name_of(role, width):
    return f"biofeedback_{role}{'' if width == SIZES[0][0] else f'_{width}'}.png"


@pytest.mark.parametrize(
    ("role", "path", "state"),
    [("subject", "/", STATE), ("operator", "/operator", STATE), ("rig", "/operator", OF_RIG)],
)
def test_a_page_looks_as_on_its_picture(open_still, tmp_path, role, path, state):
    folder = Path(os.environ.get("ANKLE_SCREENSHOTS") or tmp_path)
    differences, wrong = {}, {}
    for width, height in SIZES:
        page = open_still(path, width, height, state)
        probe = page.evaluate(PROBE)
        if abs(probe - PROBE_WIDTH) > 0.01 * PROBE_WIDTH:
            pytest.skip(f"the pictures were taken with other letters (probe of {probe:g} pixels)")
        found = take(page, folder / name_of(role, width))
        differences[width] = difference(found, DOCS / name_of(role, width))
        if problems := page.evaluate(CHECK):
            wrong[width] = problems
        page.close()
    assert wrong == {}
    assert max(differences.values()) <= LARGEST_SHARE, differences


def test_a_panel_that_moves_is_found(open_still, tmp_path):
    page = open_still("/operator", 1366, 768)
    before = take(page, tmp_path / "before.png")
    assert difference(take(page, tmp_path / "again.png"), before) == 0.0
    page.evaluate("document.querySelector('#events').style.transform = 'translateX(-24px)'")
    assert difference(take(page, tmp_path / "moved.png"), before) > LARGEST_SHARE
    page.evaluate("document.querySelector('#events').style.transform = ''")
    page.evaluate("document.querySelector('#share').style.visibility = 'hidden'")
    assert difference(take(page, tmp_path / "gone.png"), before) > LARGEST_SHARE
