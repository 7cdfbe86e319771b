"""Every page at every width: no words over one another, none cut, measured in a real Chromium."""

import json
import os
from dataclasses import replace
from importlib import resources
from pathlib import Path

import pytest
from laboratory import CALIBRATED, FakeCalibration, Laboratory, short_protocol, until
from test_pages import PATIENCE, hold_keys, run_to

from biofeedback.session.course import load_course
from biofeedback.session.course_session import CourseSession

pytestmark = [pytest.mark.live, pytest.mark.untimed]

CHECK = (Path(__file__).parent / "layout_check.js").read_text()
CANVAS_WORDS = (Path(__file__).parent / "canvas_words.js").read_text()
"""Runs in a page before its own scripts, so that the check sees the words on canvases, too."""
SIZES = ((3840, 2160), (1920, 1080), (1366, 768), (820, 1180), (390, 844), (844, 390))
OPERATOR_SIZES = ((1920, 1080), (1366, 768), (1280, 720), (820, 1180), (390, 844))
LARGEST_AND_SMALLEST = tuple(
    size if size in (SIZES[0], SIZES[-2]) else pytest.param(*size, marks=pytest.mark.slow)
    for size in SIZES
)
LANGUAGES = ("en", "nl", "de", "fr")
SHOW = (Path(__file__).parent / "feed_view.js").read_text()


def texts(language):
    folder = resources.files("biofeedback") / "pages" / "texts"
    return json.loads((folder / f"{language}.json").read_text())


@pytest.fixture
def open_sized(browser, laboratory):
    pages = []

    def open_one(path, width, height):
        page = browser.new_page(viewport={"width": width, "height": height})
        page.add_init_script(CANVAS_WORDS)
        page.set_default_timeout(PATIENCE)
        page.goto(laboratory.url(path))
        pages.append(page)
        return page

    yield open_one
    for page in pages:
        page.close()


def cases():
    """Every instruction with every hint or quality that can stand beside it."""
    words = texts("en")
    for instruction in words["instruction"]:
        yield instruction, "", "valid"
    for hint in words["hint"]:
        yield "hold", hint, "valid"
    for quality in words["quality"]:
        yield "reach", "", quality


@pytest.mark.parametrize(("width", "height"), LARGEST_AND_SMALLEST)
def test_the_subjects_screen_in_every_language(open_sized, width, height):
    page = open_sized("/", width, height)
    wrong = {}
    for language in LANGUAGES:
        for instruction, hint, quality in cases():
            page.evaluate(SHOW, [language, instruction, hint, quality, bool(hint)])
            if found := page.evaluate(CHECK):
                wrong[language, instruction, hint, quality] = found
        shown = page.evaluate("document.querySelector('canvas').clientHeight")
        assert shown > 0.3 * height, f"the plot is {shown} of {height} pixels high"
    assert wrong == {}


def test_the_check_finds_what_it_is_for(open_sized):
    page = open_sized("/operator", 1366, 768)
    page.locator("#link", has_text="● connected").wait_for()
    page.evaluate("document.querySelector('#title').style.marginRight = '-90px'")
    assert any("over one another" in one for one in page.evaluate(CHECK))
    page.evaluate("document.querySelector('#title').style.marginRight = '0'")
    page.evaluate(
        "Object.assign(document.querySelector('#title').style, "
        "{ overflow: 'hidden', width: '30px', whiteSpace: 'nowrap' })"
    )
    assert any("cut" in one for one in page.evaluate(CHECK))
    # Words on a canvas count, too: the names of the signals in a panel that is too low for them.
    assert not any("Angle" in one for one in page.evaluate(CHECK))
    page.evaluate("document.querySelector('#traces').style.height = '150px'")
    # The page's own policy lets nobody evaluate text in it, as the browser's waiting would.
    redrawn = "document.querySelector('#traces').words.at(-1).top < 150"
    until(lambda: page.evaluate(redrawn), "the panel is drawn again")
    found = page.evaluate(CHECK)
    assert any("over one another" in one and "Angle" in one for one in found), found


def test_the_operators_page(open_sized, laboratory):
    page = open_sized("/operator", 1920, 1080)
    page.locator("#link", has_text="● connected").wait_for()
    run_to(laboratory, page, "baseline measured")
    laboratory.signals.feed_status(
        "rig_with_a_long_name", 2, "emergency stop is pressed; " * 8, {}, float("inf")
    )
    page.locator("#nodes li.error").wait_for()
    page.locator("#recording", has_text="● recording").wait_for()
    wrong = {}
    for view in ("expert", "simple"):
        for width, height in OPERATOR_SIZES:
            page.set_viewport_size({"width": width, "height": height})
            page.wait_for_timeout(250)
            if found := page.evaluate(CHECK):
                wrong[view, width] = found
            stop = page.locator('button[data-command="stop"]').bounding_box()
            assert stop["y"] + stop["height"] < height
        page.locator("#simple").click()
    assert wrong == {}


def test_the_operator_is_led_through_the_check_list(browser, tmp_path):
    names = ("rig_calibration", "zero", "mvc_plantarflexion", "warm_up")
    protocol = replace(short_protocol(tmp_path), check_list=names)
    laboratory = Laboratory(protocol)
    page = browser.new_page(viewport={"width": 1366, "height": 768})
    page.set_default_timeout(PATIENCE)
    try:
        page.goto(laboratory.url("/operator"))
        page.locator("#claim").click()
        first = page.locator("#checks li", has_text="Rig calibration in date")
        first.locator("button", has_text="Confirm").click()
        first.locator("b", has_text="✓").wait_for()
        hold_keys(page, "Enter", "a")
        page.locator("#alarm", has_text="check list is not complete: Zero").wait_for()
        zero = page.locator("#checks li", has_text="Zero")
        zero.locator("button", has_text="Measure").click()
        wrong = {}
        for width, height in OPERATOR_SIZES:
            page.set_viewport_size({"width": width, "height": height})
            page.wait_for_timeout(200)
            if found := page.evaluate(CHECK):
                wrong[width] = found
        assert wrong == {}
        zero.locator("b", has_text="✓").wait_for()
        for title in ("Maximal push", "Warm-up"):
            entry = page.locator("#checks li", has_text=title)
            entry.locator("button", has_text="Skip").click()
        page.locator("#check-list").wait_for(state="hidden")
        hold_keys(page, "Enter", "a")
        page.locator("#state", has_text="armed").wait_for()
    finally:
        page.close()
        laboratory.close()
    written = [event.event for event in laboratory.events if event.event.startswith("check")]
    assert written == ["check done", "check done", "check skipped", "check skipped"]


def test_the_operator_sees_the_calibration_of_the_session(browser, tmp_path):
    calibration = FakeCalibration()
    laboratory = Laboratory(short_protocol(tmp_path, more=CALIBRATED), calibration=calibration)
    page = browser.new_page(viewport={"width": 1366, "height": 768})
    page.set_default_timeout(PATIENCE)
    try:
        page.goto(laboratory.url("/operator"))
        page.locator("#claim").click()
        entry = page.locator("#checks li", has_text="Session calibration")
        entry.locator("button", has_text="Calibrate").click()
        page.locator("#alarm", has_text="needs the running perturbation").wait_for()
        assert calibration.begun == []
        page.locator("#checks li", has_text="Warm-up").locator("button").first.click()
        page.locator('button[data-command="arm"]:enabled').wait_for()
        hold_keys(page, "Enter", "a")
        page.locator("#state", has_text="armed").wait_for()
        hold_keys(page, "Enter", "s")
        page.locator("#step", has_text="Calibration, relaxed").wait_for()
        entry.locator("p", has_text="recording, 34 of 90 s").wait_for()
        assert (found := page.evaluate(CHECK)) == [], found
        calibration.finish("the recording is too noisy")
        entry.locator("p", has_text="✕ Session calibration the recording is too noisy").wait_for()
        entry.locator("button", has_text="Calibrate again").click()
        until(lambda: calibration.begun == [90.0, 90.0], "begun again")
        calibration.finish(found="tissue friction")
        page.locator("#step", has_text="Baseline").wait_for()
        page.locator("#check-list").wait_for(state="hidden")
    finally:
        page.close()
        laboratory.close()


def test_the_pages_of_a_conditioning_course(browser, tmp_path):
    course = load_course("down_training")
    trials = CourseSession(course, course.baseline_sessions + 1)
    for number in range(course.control_trials + 5):
        trials.record(1e-6 * (1.0 + 0.1 * (number % 7)))
    laboratory = Laboratory(None, next_of_course=lambda: trials)
    laboratory.rig.present = False
    checks = laboratory.runner.checks.entries
    checks.names, checks.states = (), {}
    operator, subject = browser.new_page(), browser.new_page()
    wrong = {}
    try:
        for page, path in ((subject, "/"), (operator, "/operator")):
            page.set_default_timeout(PATIENCE)
            page.goto(laboratory.url(path))
        operator.bring_to_front()
        operator.locator("#link", has_text="● connected").wait_for()
        laboratory.session.arm(0.0)
        laboratory.session.start(0.0)
        operator.locator("#step", has_text="Trials, conditioned").wait_for()
        operator.locator("#where-what", has_text="trial 25 of 245").wait_for()
        subject.locator(".v-detail", has_text="Trial 26 of 245").wait_for()
        assert operator.locator("#target-now", has_text="µV·s").is_visible()
        for width, height in OPERATOR_SIZES:
            for name, page in (("operator", operator), ("subject", subject)):
                page.set_viewport_size({"width": width, "height": height})
                page.wait_for_timeout(200)
                if found := page.evaluate(CHECK):
                    wrong[name, width] = found
        assert laboratory.session.state == "running"
    finally:
        operator.close()
        subject.close()
        laboratory.close()
    assert wrong == {}


def test_stop_stays_in_sight_when_the_page_is_scrolled(open_sized):
    page = open_sized("/operator", 390, 844)
    page.evaluate("window.scrollTo(0, document.body.scrollHeight)")
    until(lambda: page.evaluate("window.scrollY") > 200, "scrolled")
    box = page.locator('button[data-command="stop"]').bounding_box()
    assert 0 <= box["y"] <= 100


@pytest.mark.parametrize("language", LANGUAGES[1:])
def test_every_language_has_every_text(language):
    def keys(content, path=()):
        for key, value in content.items():
            yield from keys(value, (*path, key)) if isinstance(value, dict) else [(*path, key)]

    def places(content, path):
        for key in path:
            content = content[key]
        return {word for word in content.replace("}", "{").split("{")[1::2]}

    english, other = texts("en"), texts(language)
    assert sorted(keys(other)) == sorted(keys(english))
    for path in keys(english):
        assert places(other, path) == places(english, path)


def test_the_page_that_asks_for_the_token(browser, tmp_path):
    laboratory = Laboratory(short_protocol(tmp_path), token="0123456789abcdef0123")
    wrong = {}
    try:
        for width, height in SIZES:
            page = browser.new_page(viewport={"width": width, "height": height})
            page.set_default_timeout(PATIENCE)
            page.goto(laboratory.url("/"))
            page.locator('input[name="token"]').wait_for()
            assert "The terminal that started" in page.locator("p").inner_text()
            if found := page.evaluate(CHECK):
                wrong[width] = found
            if (folder := os.environ.get("ANKLE_SCREENSHOTS")) and width == SIZES[-2][0]:
                page.screenshot(path=Path(folder) / f"biofeedback_token_{width}.png")
            page.close()
        assert wrong == {}
    finally:
        laboratory.close()
