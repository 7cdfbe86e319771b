"""The pages in a real Chromium: the cursor is where the estimate says, stale data shows, two
operators agree.
"""

import time

import pytest
from laboratory import close_to, until

pytestmark = [pytest.mark.live, pytest.mark.untimed]

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
    lost = ("WebSocket", "ERR_CONNECTION_REFUSED")
    assert [error for error in errors if not any(word in error for word in lost)] == []


def cursor(page):
    """Quality, and the cursor's place in parts of the axes, from its pixels; None before a page
    that was just opened has drawn anything.
    """
    found = page.evaluate(
        """() => { const { quality, x, y, plot } = document.getElementById('screen')?.dataset ?? {};
                   return plot ? [quality, +x, +y, ...plot.split(' ').map(Number)] : null; }"""
    )
    if found is None:
        return None, None, None
    quality, x, y, left, top, wide, tall = found
    return quality, (x - left) / wide, 1.0 - (y - top) / tall


def hold_keys(page, *keys, seconds=1.3):
    """Hold keys together, as a person does."""
    for key in keys:
        page.keyboard.down(key)
    page.wait_for_timeout(1000.0 * seconds)
    for key in keys:
        page.keyboard.up(key)


def press(page, button):
    """Press the mouse on the middle of a button, and keep it down."""
    box = button.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()


def run_to(laboratory, page, wanted, seconds=180.0):
    """Arm and start as an operator does, until the session says that something happened.

    On a busy computer the page may see keys that were held for a second as held for less, and a
    page without processor time for two seconds stops the session, as it must. Both are then done
    again. An event is waited for, because a step may be over before it is looked at.
    """
    page.bring_to_front()  # a browser slows the clock of a page that is behind another
    page.locator("#claim").click()
    keys = {"idle": "a", "paused": "a", "armed": "s"}
    deadline, held = time.monotonic() + seconds, 1.3
    while not any(event.event == wanted for event in laboratory.events):
        stopped = [e.details for e in laboratory.events if e.event == "session stopped"]
        assert all("no operator's page" in details["reason"] for details in stopped), stopped
        assert time.monotonic() < deadline, (wanted, laboratory.session.state, laboratory.events)
        key = keys.get(laboratory.session.state)
        if key is None:
            page.wait_for_timeout(20)
            continue
        name = {"a": "arm", "s": "start"}[key]
        page.locator(f'button[data-command="{name}"]:enabled').wait_for()
        hold_keys(page, "Enter", key, seconds=held)
        before, held = laboratory.session.state, min(1.5 * held, 6.0)
        patience = time.monotonic() + 3.0  # the rig agrees after the keys are released
        while laboratory.session.state == before and time.monotonic() < patience:
            page.wait_for_timeout(20)


def colour_at_cursor(page):
    return page.evaluate(
        """() => { const canvas = document.getElementById('screen'), d = canvas.dataset;
                   const [, , wide, tall] = d.plot.split(' ').map(Number);
                   const aside = 0.02 * Math.min(wide, tall);
                   const context = canvas.getContext('2d');
                   return [...context.getImageData(+d.x + aside, +d.y, 1, 1).data]; }"""
    )


DASHED_RIM = """() => { const canvas = document.getElementById('screen'), { x, y } = canvas.dataset;
    const radius = 0.034 * Math.min(canvas.width, canvas.height), context = canvas.getContext('2d');
    let white = 0;
    for (let k = 0; k < 60; k++) {
      const angle = (2 * Math.PI * k) / 60;
      const at = [+x + radius * Math.cos(angle), +y + radius * Math.sin(angle)];
      const [red, green, blue] = context.getImageData(...at, 1, 1).data;
      white += Math.min(red, green, blue) > 200;
    }
    return white < 50; }"""
"""Whether a part of the cursor's white rim is not drawn."""


def test_the_cursor_moves_where_the_estimate_says(laboratory, open_page):
    subject, operator = open_page("/"), open_page("/operator")
    run_to(laboratory, operator, "baseline measured")
    lower, upper = laboratory.runner.view.axes["x"]
    bottom, top = laboratory.runner.view.axes["y"]
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
    run_to(laboratory, operator, "baseline measured")
    until(lambda: cursor(subject)[0] == "valid", "valid")
    looks = {"valid": subject.screenshot()}
    laboratory.estimator_says = "estimates are doubtful: tissue relaxes; other"
    operator.get_by_text("estimates are doubtful: tissue relaxes", exact=False).first.wait_for()
    until(lambda: subject.evaluate(DASHED_RIM), "dashed rim")
    laboratory.estimator_says = "running"
    until(lambda: not subject.evaluate(DASHED_RIM), "closed rim")
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


def test_two_operators_agree_and_one_is_in_command(laboratory, open_page):
    one, other = open_page("/operator", 1600, 950), open_page("/operator", 1600, 950)
    one.locator("#claim").click()
    other.locator("#claim", has_text="Take over command").wait_for()
    assert other.locator('button[data-command="arm"]').is_disabled()
    one.bring_to_front()
    one.locator('button[data-command="arm"]:enabled').wait_for()
    hold_keys(one, "Enter", "a")
    other.locator("#state", has_text="armed").wait_for()
    other.locator("#claim").click()
    field = other.locator('input[name="torque[N.m]"]')
    field.fill("-3")
    field.press("Enter")
    one.locator("#target-now", has_text="-3 ± 1 N·m").wait_for()
    other.bring_to_front()
    other.locator('button[data-command="start"]:enabled').wait_for()
    hold_keys(other, "Enter", "s")
    one.locator("#state", has_text="running").wait_for()
    one.keyboard.press(" ")  # not in command, but a stop is everybody's
    for page in (one, other):
        page.locator("#state", has_text="idle").wait_for()
    assert laboratory.rig.requests == ["arm", "start", "stop"]


def test_what_moves_a_foot_must_be_meant(laboratory, open_page):
    page = open_page("/operator", 1600, 950)
    page.locator("#claim").click()
    arm = page.locator('button[data-command="arm"]:enabled')
    arm.wait_for()
    page.keyboard.type("armandstartplease")
    page.keyboard.press("Enter")
    arm.click()
    page.locator("#alarm", has_text="keep the button pressed").wait_for()
    hold_keys(page, "a")
    hold_keys(page, "Enter", "a", seconds=0.4)
    assert laboratory.rig.requests == []
    press(page, arm)
    page.locator("#state", has_text="armed").wait_for()
    page.mouse.up()
    assert laboratory.rig.requests == ["arm"]


def test_an_alarm_that_comes_and_goes_neither_moves_the_buttons_nor_ends_a_hold(
    laboratory, open_page
):
    page = open_page("/operator", 1600, 950)
    page.locator("#claim").click()
    arm = page.locator('button[data-command="arm"]:enabled')
    arm.wait_for()
    before = arm.bounding_box()
    arm.click()
    page.locator("#alarm").wait_for()
    assert arm.bounding_box() == before
    # Who slides off the button did not mean it.
    press(page, arm)
    page.wait_for_timeout(300)
    page.mouse.move(before["x"] + before["width"] / 2, before["y"] - 20)
    page.wait_for_timeout(1200)
    page.mouse.up()
    assert laboratory.rig.requests == []
    # Whatever moves the page, who holds what was pressed means it.
    press(page, arm)
    page.wait_for_timeout(300)
    page.evaluate("document.querySelector('header').style.paddingTop = '150px'")
    page.locator("#state", has_text="armed").wait_for()
    page.mouse.up()
    assert laboratory.rig.requests == ["arm"]


# Longer than anybody waits for its end, so that only keys can end it.
@pytest.mark.parametrize("laboratory", [120], indirect=True)
def test_a_key_does_not_end_a_hold(laboratory, open_page):
    page = open_page("/operator", 1600, 950)
    run_to(laboratory, page, "hold started")
    page.keyboard.type("hnpre")
    page.keyboard.press("Enter")
    page.wait_for_timeout(300)
    assert laboratory.session.step.hold == 1
    assert laboratory.session.holding
    hold_keys(page, "Enter", "e")
    until(lambda: not laboratory.session.holding, "the hold is ended")


@pytest.mark.parametrize("key", ["Escape", " "])
def test_every_stop_key_stops_from_the_subjects_screen(laboratory, open_page, key):
    subject, operator = open_page("/"), open_page("/operator")
    run_to(laboratory, operator, "session started")
    subject.bring_to_front()
    subject.keyboard.press(key)
    operator.locator("#state", has_text="idle").wait_for()
    assert laboratory.rig.requests == ["arm", "start", "stop"]
    subject.locator(".v-instruction", has_text="Stopped").wait_for()


def test_stop_is_never_disabled_and_an_unconfirmed_one_is_loud(laboratory, open_page):
    page = open_page("/operator")
    stop = page.locator('button[data-command="stop"]')
    assert stop.is_enabled()
    stop.click()
    until(lambda: laboratory.rig.requests == ["stop"], "the stop")
    laboratory.rig.unconfirmed = ["test_rig"]
    page.locator("#alarm", has_text="STOP NOT CONFIRMED by test_rig").wait_for()


def test_a_stop_without_a_connection_is_kept_and_reported(laboratory, open_page, tmp_path):
    from laboratory import Laboratory, short_protocol

    pages = [open_page("/operator"), open_page("/")]
    port = laboratory.port
    laboratory.close()
    pages[0].locator("#link", has_text="no connection").wait_for()
    for page in pages:
        page.keyboard.press("Escape")
        page.locator("#undelivered", has_text="STOP").wait_for()
    again = Laboratory(short_protocol(tmp_path), port=port)
    try:
        until(lambda: again.rig.requests.count("stop") >= 2, "both stops", 60.0)
        for page in pages:
            page.locator("#undelivered").wait_for(state="hidden")
    finally:
        again.close()


def test_keys_typed_into_a_field_command_nothing_but_escape_stops(laboratory, open_page):
    page = open_page("/operator", 1600, 950)
    run_to(laboratory, page, "session started")
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
    page.locator("#simulated-subject").wait_for(state="visible")
    page.locator('#simulated-subject input[name="push"]').fill("4")
    until(lambda: laboratory.subject.values["push"] == 4.0, "the simulated subject pushes")
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


def test_a_page_whose_browser_is_not_known_any_more_says_so(browser, tmp_path):
    from laboratory import Laboratory, short_protocol

    token = "0123456789abcdef0123"
    laboratory = Laboratory(short_protocol(tmp_path), token=token)
    page = browser.new_page()
    page.set_default_timeout(PATIENCE)
    page.goto(laboratory.url(f"/enter#{token}"))
    page.locator("#link", has_text="● connected").wait_for()
    assert page.locator("#entrance").is_hidden()
    laboratory.close()
    again = Laboratory(short_protocol(tmp_path), token=token, port=laboratory.port)
    try:
        page.locator("#entrance", has_text="Enter the code again").wait_for()
        page.locator("#entrance a").click()
        page.locator('input[name="token"]').fill(token)
        page.locator("button").click()
        page.locator("#link", has_text="● connected").wait_for()
        assert page.locator("#entrance").is_hidden()
    finally:
        page.close()
        again.close()
