"""The page of a recording: every sample is in it, peaks survive, gaps and losses are shown."""

import base64
import json
import re

import numpy as np
import pytest

from ankle_interfaces.block import Block
from session_analysis.recording_page import GAP, Track, coarsened, label, write_recording_page
from session_recorder.bag_writer import BagWriter
from session_recorder.errors import BagError

RATE = 1000


def write_bag(path, left_out=()):
    time = 50 + np.arange(8 * RATE) / RATE
    torque = np.sin(7 * time)
    torque[4321] = 30.0
    with BagWriter(path) as writer:
        writer.add_topic("/ankle/samples")
        for number, first in enumerate(range(0, len(time), 40)):
            if number not in left_out:
                data = np.column_stack([time, torque])[first : first + 40]
                writer.write_block("/ankle/samples", Block(("t[s]", "torque[N.m]"), data))
    return torque


def content(path):
    text = path.read_text()
    return json.loads(re.search(r"const RECORDING=(\{.*?\});\n", text)[1]), text


def test_every_sample_is_in_the_page_and_gaps_stay_gaps(tmp_path):
    torque = write_bag(tmp_path / "bag", left_out=(10,))
    page = write_recording_page(tmp_path / "bag", tmp_path / "page.html")
    held, text = content(page)
    (track,) = held["tracks"]
    numbers = np.frombuffer(base64.b64decode(track["data"]), "<i2")
    assert track["name"] == "/ankle/samples torque[N.m]"
    assert (numbers == GAP).nonzero()[0].tolist() == list(range(400, 440))
    values = track["low"] + (numbers.astype(float) + track["half"]) * track["scale"]
    seen = numbers != GAP
    np.testing.assert_allclose(values[seen], torque[seen], atol=track["scale"])
    assert "40 samples (0.040 s) are missing in 1 gap" in text
    assert "make one with 'ankle diagnose'" in text or "make one with &#x27;ankle" in text
    assert not re.search(r"<(script|link|img)[^>]+(src|href)=.http", text)


def test_a_peak_survives_what_a_long_recording_leaves_out():
    values = np.zeros(10_001, dtype=np.float32)
    values[5003], values[7000:7100] = 9.0, np.nan
    coarse = coarsened(Track("a", 0.0, 0.001, values), 20)
    assert np.nanmax(coarse.values) == 9.0
    at = int(np.nanargmax(coarse.values))
    assert coarse.step * at == pytest.approx(5.003, abs=0.02)
    assert np.isnan(coarse.values).sum() == 2 * 5
    assert coarsened(coarse, 1) is coarse


def test_the_commanded_angle_is_told_from_the_measured_one():
    assert label("/perturbation/reference position[rad]") == "commanded position [rad]"
    assert label("/ankle/samples position[rad]") == "position [rad]"


def test_the_diagnosis_beside_a_recording_is_shown(tmp_path):
    write_bag(tmp_path / "bag")
    folder = tmp_path / "diagnosis"
    folder.mkdir()
    verdict = {"verdict": "explained", "effects": [{"sentence": "The straps give way."}]}
    (folder / "verdict.json").write_text(json.dumps(verdict))
    text = write_recording_page(tmp_path / "bag", tmp_path / "p.html", folder).read_text()
    assert "Physics is missing from the basic model, and it was found." in text
    assert "The straps give way." in text
    assert "report.html" not in text
    (folder / "report.html").write_text("all of it")
    text = write_recording_page(tmp_path / "bag", tmp_path / "p.html", folder).read_text()
    assert (folder / "report.html").as_uri() in text


def test_the_estimates_of_a_recording_are_shown_with_their_doubts(tmp_path):
    write_bag(tmp_path / "bag")
    with BagWriter(tmp_path / "bag_estimates") as writer:
        writer.custom_data = {"doubts": "40 % of the time: tissue relaxes", "not_valid": ""}
        writer.add_topic("/impedance/estimate")
        data = np.column_stack([50 + np.arange(512) / 64, np.full((512, 2), (90.0, 1.0))])
        columns = ("t[s]", "K[N.m/rad]", "valid[1]")
        writer.write_block("/impedance/estimate", Block(columns, data))
    page = write_recording_page(
        tmp_path / "bag", tmp_path / "p.html", None, tmp_path / "bag_estimates"
    )
    held, text = content(page)
    assert "/impedance/estimate K[N.m/rad]" in [track["name"] for track in held["tracks"]]
    assert "doubtful for 40 % of the time: tissue relaxes" in text
    alone = write_recording_page(tmp_path / "bag", tmp_path / "p.html").read_text()
    assert "make them with &#x27;ankle estimate&#x27;" in alone


def test_a_bag_with_nothing_to_draw_is_refused(tmp_path):
    with BagWriter(tmp_path / "bag"):
        pass
    with pytest.raises(BagError, match="nothing to draw"):
        write_recording_page(tmp_path / "bag", tmp_path / "p.html")


@pytest.mark.live
@pytest.mark.untimed
def test_titles_of_axes_do_not_overlap(browser, tmp_path):
    time = np.arange(0.0, 8.0, 1 / RATE)
    columns = ("t[s]", "position[rad]", "velocity[rad/s]")
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/perturbation/reference")
        data = np.column_stack([time, np.sin(time), np.cos(time)])
        for first in range(0, len(time), 40):
            writer.write_block("/perturbation/reference", Block(columns, data[first : first + 40]))
    path = write_recording_page(tmp_path / "bag", tmp_path / "page.html")
    page = browser.new_page(viewport={"width": 1366, "height": 900})
    try:
        page.goto(path.as_uri())
        page.wait_for_selector(".y2title")
        upper, lower = page.evaluate(
            "['.ytitle', '.y2title'].map(one => {const box = document.querySelector(one)"
            ".getBoundingClientRect(); return [box.left, box.top, box.bottom]})"
        )
    finally:
        page.close()
    assert min(upper[0], lower[0]) >= 0
    assert upper[2] <= lower[1]
