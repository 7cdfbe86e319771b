"""The pages in a real Chromium: the cursor is where the estimate says, stale data shows, two
operators agree.
"""

import pytest
from laboratory import close_to, until

pytestmark = pytest.mark.live

PATIENCE = 60_000  # ms


@pytest.fixture
def open_page(browser, laboratory):
    """Opens a page, and afterwards requires that it had no errors."""
    errors, pages = [], []

    def open_one(path, width=1280, height=720):
        page = browser.new_page(viewport={"width": width, "height": height})
        page.set_default_timeout(PATIENCE)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on(
            "console",
            lambda message: errors.append(message.text) if message.type == "error" else None,
        )
        page.goto(laboratory.url(path))
        if path == "/operator":
            page.locator("#link", has_text="● connected").wait_for()
        pages.append(page)
        return page

    yield open_one
    for page in pages:
        page.close()
    assert [error for error in errors if "WebSocket" not in error] == []


def cursor(page):
    """Quality, and the cursor's place in the units of the axes, from its pixels."""
    found = page.evaluate(
        """() => { const { dataset: d, width, height } = document.getElementById('screen');
                   return [d.quality, +d.x, +d.y, width, height]; }"""
    )
    quality, x, y, width, height = found
    left, top, wide, tall = 0.15 * height, 0.2 * height, width - 0.21 * height, 0.63 * height
    return quality, (x - left) / wide, 1.0 - (y - top) / tall


def run_to(laboratory, page, kind):
    page.keyboard.press("a")
    until(lambda: laboratory.session.state == "armed", "armed", 60.0)
    page.keyboard.press("s")
    until(lambda: laboratory.session.step.kind == kind, kind, 90.0)


def colour_at_cursor(page):
    return page.evaluate(
        """() => { const canvas = document.getElementById('screen'), d = canvas.dataset;
                   return [...canvas.getContext('2d').getImageData(+d.x + 0.02 * canvas.height, +d.y, 1, 1).data]; }"""  # noqa: E501
    )


def test_the_cursor_moves_where_the_estimate_says(laboratory, open_page):
    subject, operator = open_page("/"), open_page("/operator")
    run_to(laboratory, operator, "reach")
    lower, upper = laboratory.desk.axes()["x"]
    bottom, top = laboratory.desk.axes()["y"]
    for G, torque in ((12.0, 2.0), (4.0, -3.0)):
        laboratory.G, laboratory.torque = G, torque
        x, y = (G - lower) / (upper - lower), (torque - bottom) / (top - bottom)
        until(
            lambda x=x, y=y: (
                close_to(cursor(subject)[1], x, 0.02) and close_to(cursor(subject)[2], y, 0.02)
            ),
            f"cursor at {x}, {y}",
            60.0,
        )
        assert cursor(subject)[0] == "valid"
        # The pixels there are a cursor's, not only the numbers.
        assert colour_at_cursor(subject)[:3] in ([230, 159, 0], [0, 179, 132])


def test_invalid_stale_and_lost_look_different_and_nothing_freezes(laboratory, open_page):
    subject, operator = open_page("/"), open_page("/operator")
    run_to(laboratory, operator, "reach")
    until(lambda: cursor(subject)[0] == "valid", "valid")
    looks = {"valid": subject.screenshot()}
    laboratory.valid = False
    until(lambda: cursor(subject)[0] == "invalid", "invalid")
    assert colour_at_cursor(subject)[:3] not in ([230, 159, 0], [0, 179, 132])
    looks["invalid"] = subject.screenshot()
    laboratory.streaming = False
    until(lambda: cursor(subject)[0] == "stale", "stale")
    looks["stale"] = subject.screenshot()
    drawn = int(subject.evaluate("document.getElementById('screen').dataset.drawn"))
    until(
        lambda: (
            int(subject.evaluate("document.getElementById('screen').dataset.drawn")) > drawn + 5
        ),
        "still drawn",
    )
    operator.get_by_text("estimates are stale").wait_for()
    laboratory.close()
    until(lambda: cursor(subject)[0] == "lost", "lost")
    looks["lost"] = subject.screenshot()
    operator.get_by_text("no connection to the node").wait_for()
    assert len(set(looks.values())) == 4


def test_two_operators_agree(laboratory, open_page):
    one, other = open_page("/operator", 1600, 950), open_page("/operator", 1600, 950)
    one.keyboard.press("a")
    other.locator("#state", has_text="armed").wait_for()
    field = other.locator('input[name="torque[N.m]"]')
    field.fill("-3")
    field.press("Enter")
    one.locator("#target-now", has_text="-3 ± 1 N·m").wait_for()
    other.keyboard.press("s")
    one.locator("#state", has_text="running").wait_for()
    one.keyboard.press(" ")
    for page in (one, other):
        page.locator("#state", has_text="idle").wait_for()
    assert laboratory.rig.told == ["arm", "start", "stop"]


def test_keys_typed_into_a_field_command_nothing_but_escape_stops(laboratory, open_page):
    page = open_page("/operator", 1600, 950)
    run_to(laboratory, page, "baseline")
    note = page.locator('#note input[name="text"]')
    note.click()
    page.keyboard.type("a pause near the stop")
    page.keyboard.press("Enter")
    page.locator("#log", has_text="a pause near the stop").wait_for()
    assert laboratory.session.state == "running"
    note.click()
    page.keyboard.press("Escape")
    page.locator("#state", has_text="idle").wait_for()


def test_what_an_operator_sees(laboratory, open_page):
    page = open_page("/operator", 1600, 950)
    page.locator("#recording", has_text="● recording").wait_for()
    assert page.locator("#disk").inner_text() == "182.0 GB free"
    laboratory.signals.feed_status("test_rig", 2, "emergency stop is pressed", {}, float("inf"))
    page.locator("#nodes li.error", has_text="emergency stop is pressed").wait_for()
    page.locator("#log li.error", has_text="fault").wait_for()
    page.locator("#person").wait_for(state="visible")
    page.locator('#person input[name="push"]').fill("4")
    until(lambda: laboratory.person.values["push"] == 4.0, "the simulated subject pushes")
    laboratory.rig.present = False
    page.locator("#rig", has_text="no rig driver").wait_for()


def test_a_page_goes_on_after_the_node_was_started_anew(laboratory, open_page, tmp_path):
    from laboratory import Laboratory, short_protocol

    page = open_page("/")
    until(lambda: cursor(page)[0] == "valid", "valid")
    port = laboratory.port
    laboratory.close()
    until(lambda: cursor(page)[0] == "lost", "lost")
    again = Laboratory(short_protocol(tmp_path), port=port)
    try:
        until(lambda: cursor(page)[0] == "valid", "valid again", 60.0)
    finally:
        again.close()
