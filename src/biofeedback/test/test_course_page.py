"""The pages of a conditioning course: numbers in units that are read, nothing cut, what follows a
finished session, and the success rate in the subject's view.
"""

import json
from dataclasses import asdict, replace

import pytest
from test_layout import CANVAS_WORDS, CHECK
from test_pages import PATIENCE
from test_pictures import FRAME, FROZEN_CLOCK, SIZES, START, STATE, TRACES, check

from biofeedback.web import messages

pytestmark = [pytest.mark.live, pytest.mark.untimed]

TRIALS = messages.TrialsState(
    session=2,
    sessions=30,
    done=3,
    planned=245,
    kind="conditioned",
    success_rate=2 / 3,
    last_success=True,
    activity=None,
    activity_window=[0.05, 0.2],
    held=False,
    waiting=False,
)
COURSE = replace(
    STATE,
    session=replace(STATE.session, state="running", kind="trials"),
    target=messages.TargetState("reflex", "uV.s", -5.0, 1.0, 0.0, 0.3059),
    axes=messages.Axes([0.0, 0.3059], [-13.25, 4.125], []),
    baseline=None,
    trials=TRIALS,
    checks=[
        check("zero", "Zero", "done", {"torque[N.m]": 0.029812, "angle[rad]": 0.0349066}),
        check("mvc_plantarflexion", "Maximal push", "open", {}),
    ],
    log=[messages.LogEntry(START, "trial", {"trial": 3, "reflex_emg[V.s]": 2.1345e-7})],
)


@pytest.fixture
def open_state(browser, laboratory):
    """Return what opens a page of a state, the operator's unless another is named."""
    pages = []

    def open_one(state, width=1280, height=720, traces=TRACES, path="/operator"):
        def answer(socket):
            socket.on_message(lambda text: None)
            for message in (messages.Command(True), state, traces, FRAME):
                socket.send(json.dumps(asdict(message)))

        page = browser.new_page(viewport={"width": width, "height": height})
        page.set_default_timeout(PATIENCE)
        page.add_init_script(FROZEN_CLOCK)
        page.add_init_script(CANVAS_WORDS)
        page.route_web_socket("**/ws*", answer)
        page.goto(laboratory.url(path))
        page.locator("#log li" if path == "/operator" else ".v-detail").first.wait_for()
        pages.append(page)
        return page

    yield open_one
    for page in pages:
        page.close()


def test_values_are_shown_in_units_that_are_read(open_state):
    page = open_state(COURSE)
    assert page.locator("#log").inner_text().endswith("trial: trial 3, reflex emg 0.213 µV·s")
    assert "Zero torque 0.03 N·m, angle 2 degrees" in page.locator("#checks").inner_text()


def test_an_activity_without_a_contraction_to_compare_with_is_explained(open_state):
    share = open_state(COURSE).locator("#share")
    share.filter(has_text="EMG counts from the maximal push of the check list").wait_for()
    done = replace(COURSE, checks=[replace(one, state="done") for one in COURSE.checks])
    open_state(done).locator("#share").filter(has_text="no EMG").wait_for()


def test_a_course_of_the_emg_reflex_says_nothing_of_estimates(open_state):
    """No estimator runs: the page asks for EMG, and leaves out what it cannot show."""
    groups = {name: bins for name, bins in TRACES.groups.items() if name != "estimate"}
    page = open_state(COURSE, traces=replace(TRACES, groups=groups))
    words = "(document.getElementById('traces').words ?? []).map(({ text }) => text)"
    page.wait_for_function(f"{words}.includes('SOL')")
    drawn = page.evaluate(words)
    assert not {"K", "G", "no valid estimate"} & set(drawn)
    assert page.locator("#target-of-course").inner_text().startswith("The course sets the target")
    assert page.locator("#target label").first.is_hidden()
    assert page.locator("#axis-now").inner_text() == "from the subject's own reflexes"


def test_a_finished_session_says_what_follows(open_state):
    finished = replace(COURSE, session=replace(COURSE.session, state="finished"))
    share = open_state(finished).locator("#share")
    share.filter(has_text="done and kept. The next session of the course").wait_for()


@pytest.mark.slow
def test_no_value_of_a_course_is_cut_at_any_width(open_state):
    wrong = {}
    for width, height in (*SIZES, (1280, 720)):
        page = open_state(COURSE, width, height)
        page.wait_for_timeout(500)
        if problems := page.evaluate(CHECK):
            wrong[width] = problems
        page.close()
    assert wrong == {}


@pytest.mark.parametrize(
    ("language", "rate", "hits"),
    [
        ("en", "Success in 67 % of the trials", "5 of 6 reached (83 %)"),
        pytest.param(
            "nl",
            "Gelukt bij 67 % van de pogingen",
            "5 van 6 gehaald (83 %)",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "de",
            "Gelungen bei 67 % der Versuche",
            "5 von 6 erreicht (83 %)",
            marks=pytest.mark.slow,
        ),
        ("fr", "Réussite dans 67 % des essais", "5 sur 6 atteints (83 %)"),
    ],
)
def test_the_subject_sees_the_success_rate(open_state, language, rate, hits):
    wrong = {}
    for state, said in ((COURSE, rate), (STATE, hits)):
        page = open_state(state, *SIZES[0], path=f"/?language={language}")
        page.locator(".v-foot", has_text=said).wait_for()
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            page.wait_for_timeout(300)
            if problems := page.evaluate(CHECK):
                wrong[said, width] = problems
    assert wrong == {}


def test_no_success_rate_is_shown_before_there_is_one(open_state):
    first = replace(COURSE, trials=replace(TRIALS, done=0, success_rate=None))
    page = open_state(first, path="/")
    page.locator(".v-detail", has_text="Trial 1 of 245").wait_for()
    assert page.locator(".v-foot").inner_text() == ""
