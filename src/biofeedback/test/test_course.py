"""Conditioning courses: what a file may say, which trials count, how a session goes on and ends."""

import itertools
import math

import numpy as np
import pytest
from course_files import COURSES_OF_THE_PACKAGE, written
from laboratory import FakeRig, FakeSubject

from biofeedback.errors import CommandError, ProtocolError
from biofeedback.live_signals import LiveSignals
from biofeedback.session.conditioning import Conditioning, Response, largest_activity
from biofeedback.session.course import CONTROL, load_course
from biofeedback.session.course_file import CourseFile
from biofeedback.session.course_record import SessionResult, load_record, new_record
from biofeedback.session.course_session import CourseSession, TrialGate
from biofeedback.session.protocol import BREAK
from biofeedback.session.runner import SessionRunner
from biofeedback.session.session_program import FINISHED, PAUSED, RUNNING, Session
from biofeedback.session.simulated_learner import Learner, SimulatedLearner
from biofeedback.session.target import Reading


def test_the_shipped_courses_are_those_of_the_published_procedure():
    for name in COURSES_OF_THE_PACKAGE:
        course = load_course(name)
        assert (course.baseline_sessions, course.conditioning_sessions) == (6, 24)
        assert CourseSession(course, 1).planned == 225
        assert CourseSession(course, 7).planned == 245
        assert 0.5 <= course.success_rate <= 0.6
        assert course.background.duration == 2.0
    assert {load_course(name).direction for name in COURSES_OF_THE_PACKAGE} == {"up", "down"}
    assert {load_course(name).measure for name in COURSES_OF_THE_PACKAGE} == {"reflex_emg", "G"}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"direction": "sideways"}, "direction = 'sideways' is refused; allowed: up, down"),
        ({"measure": "K"}, "measure = 'K' is refused"),
        ({"success_rate[1]": 55}, r"success_rate\[1\] = 55 is refused; allowed: 0.1 to 0.9"),
        ({"blocks": 2.5}, "blocks = 2.5 is refused; allowed: a whole number from 1 to 20"),
        ({"background": {"emg_lower[MVC]": 0.5}}, "is not below"),
        ({"colour": "red"}, "unknown key 'colour'"),
    ],
)
def test_mistakes_in_a_course_are_named(tmp_path, changes, words):
    with pytest.raises(ProtocolError, match=words):
        load_course(written(tmp_path, **changes))


def test_an_unknown_course_names_those_that_are_known():
    with pytest.raises(ProtocolError, match="known are demonstration, down_training, up_training"):
        load_course("sideways")


def test_a_perturbation_is_given_only_after_the_background_was_held(tmp_path):
    course = load_course(written(tmp_path))
    gate, window = TrialGate(course), course.background
    emg = 0.5 * (window.emg_lower + window.emg_upper)
    given = []
    for k in range(600):
        now = 0.1 * k
        lost = 20.0 <= now < 30.0
        if gate.update(now, window.torque, window.emg_upper + 0.1 if lost else emg):
            given.append(now)
            gate.given()
    assert given[0] == pytest.approx(2.0, abs=0.11)
    assert np.diff(given).min() >= course.trial_interval - 1e-6
    assert not [when for when in given if 20.0 <= when < 32.0 - 1e-6]


@pytest.mark.parametrize("name", COURSES_OF_THE_PACKAGE)
def test_a_subject_who_does_not_change_succeeds_at_the_stated_rate(name):
    course = load_course(name)
    session = CourseSession(course, course.baseline_sessions + 1)
    random = np.random.default_rng(3)
    while not session.finished:
        session.record(float(np.exp(random.normal(0.0, 0.3))))
    assert session.success_rate == pytest.approx(course.success_rate, abs=0.12)


def test_the_criterion_follows_the_subject_from_block_to_block(tmp_path):
    course = load_course(written(tmp_path))
    session = CourseSession(course, course.baseline_sessions + 1)
    criteria = []
    for size in (1.0, 0.8, 0.6, 0.4):
        count = course.control_trials if not session.trials else course.trials_per_block
        trials = [session.record(size * (1.0 + 0.001 * k)) for k in range(count)]
        criteria.append(trials[-1].criterion)
        # The criterion of a block stays the same within the block.
        assert len({trial.criterion for trial in trials}) == 1
    assert criteria[0] is None
    assert criteria[1:] == sorted(criteria[1:], reverse=True)
    assert criteria[1] == pytest.approx(1.0, abs=0.02)
    assert session.finished
    with pytest.raises(CommandError, match="has all its"):
        session.record(1.0)


def test_a_baseline_session_rewards_nothing(tmp_path):
    course = load_course(written(tmp_path))
    session = CourseSession(course, course.baseline_sessions)
    trials = [session.record(1.0) for _ in range(session.planned)]
    assert {trial.kind for trial in trials} == {CONTROL}
    assert math.isnan(session.success_rate)


def test_a_course_goes_on_after_months_and_after_a_crash(tmp_path):
    course = load_course(written(tmp_path))
    record = new_record(course, "S07")
    subject = SimulatedLearner(Learner(), course, seed=1)
    for _ in range(2):
        session = record.resume(course)
        subject.run_session(session)
        record.add(session, "2026-11-20")
    half = record.resume(course)
    for size in (1.0, 1.1, 0.9):
        half.record(size)
    record.unfinished = [trial.size for trial in half.trials]
    path = tmp_path / "S07.yaml"
    record.save(path)
    again = load_record(path)
    assert repr(again) == repr(record)
    resumed = again.resume(course)
    assert (resumed.number, len(resumed.trials)) == (3, 3)
    with pytest.raises(CommandError, match="another course"):
        again.resume(load_course("up_training"))
    path.write_text("results: 3")
    with pytest.raises(CommandError, match="is no record of a course"):
        load_record(path)


@pytest.mark.parametrize("subject", ["", "Anna Smith", "a@b.example", "../x"])
def test_only_a_pseudonym_names_a_subject(tmp_path, subject):
    with pytest.raises(CommandError, match="pseudonym"):
        new_record(load_course("down_training"), subject)


def texts_of(figure):
    """Every text of a picture but the axes' numbers, with its place [pixels]."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.text import Text

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    places = {}
    for text in figure.findobj(Text):
        if text.get_visible() and any(map(str.isalpha, text.get_text())):
            places[text.get_text()] = text.get_window_extent(canvas.get_renderer())
    return places


@pytest.mark.parametrize(
    ("name", "done"),
    [(name, 30) for name in COURSES_OF_THE_PACKAGE] + [(COURSES_OF_THE_PACKAGE[0], 1)],
)
def test_no_text_of_a_courses_picture_is_cut_or_covered(name, done):
    # It takes most of a second to load, in every process that shares the tests.
    from biofeedback.session.course_picture import course_figure

    course = load_course(name)
    record = new_record(course, "S01")
    number = range(1, min(done, course.sessions) + 1)
    record.results += [
        SessionResult(n, "2026-01-01", 225, 225, 1.0 + 0.1 * math.sin(n), 1.0 - 0.01 * n, 0.5)
        for n in number
    ]
    figure = course_figure(record, course)
    width, height = figure.bbox.size
    places = texts_of(figure)
    for text, place in places.items():
        assert place.x0 >= 0, text
        assert place.y0 >= 0, text
        assert place.x1 <= width, text
        assert place.y1 <= height, text
    for (text, place), (other, beside) in itertools.combinations(places.items(), 2):
        assert not place.overlaps(beside), f"{text!r} over {other!r}"
    assert not any("_" in text for text in places)
    assert any("control trials" in text for text in places)
    if done > course.baseline_sessions + 1:
        assert "minimal detectable change of one session" in places
        assert "97.6 % interval of sessions 25 to 30" in places


def led(course, behaviour, seconds=60.0, number=None, lead=1.0):
    """Lead a course session's trials in virtual time.

    `behaviour(now)` gives torque [N.m] and activity [MVC]; each stretch that is asked for comes
    `lead` later, with a reflex that grows by 1 from one to the next. Returns conditioning, events,
    and the onsets.
    """
    session = CourseSession(course, number or course.baseline_sessions + 1)
    conditioning, events, onsets, onset = Conditioning(session), [], [], None
    for k in range(round(30 * seconds)):
        now = 100.0 + k / 30
        responses = []
        if onset is not None and now > onset + 0.2:
            responses, onset = [Response(onset, float(len(onsets)))], None
        torque, activity = behaviour(now - 100.0)
        events += conditioning.tick(now, torque, activity, responses)
        if conditioning.take_request():
            onset = now + lead
            onsets.append(onset)
    return conditioning, events, onsets


def steady(course):
    window = course.background
    return window.torque, 0.5 * (window.emg_lower + window.emg_upper)


def test_a_trial_counts_only_if_the_background_was_held_until_the_stretch(tmp_path):
    course = load_course(written(tmp_path))
    held = steady(course)
    conditioning, events, onsets = led(course, lambda t: held, 30.0)
    counted = [event for event in events if event.event == "trial"]
    assert len(counted) == len(conditioning.session.trials) == 6
    assert np.diff(onsets).min() >= course.trial_interval - 1e-6
    assert onsets[0] - 100.0 >= course.background.duration
    # Who leaves it between request and stretch gets the stretch, but no trial.
    late = onsets[0] - 0.3 - 100.0
    left = lambda t: (0.0, held[1]) if late < t < late + 0.1 else held  # noqa: E731
    conditioning, events, onsets = led(course, left, 10.0)
    assert events[0].event == "trial not counted"
    assert "before the perturbation" in events[0].details["reason"]
    assert len(conditioning.session.trials) == len(onsets) - 1
    # Neither torque nor EMG alone is enough.
    for behaviour in ((held[0], 0.9), (held[0] + 3.0, held[1])):
        assert led(course, lambda t, now=behaviour: now, 10.0)[2] == []


def test_three_stretches_without_a_response_end_the_block(tmp_path):
    course = load_course(written(tmp_path))
    session = Session(next_of_course=lambda: CourseSession(course, 1))
    session.arm(0.0)
    session.start(0.0)
    torque, activity = steady(course)
    events, asked = [], 0
    for k in range(30 * 60):
        events += session.tick(k / 30, Reading(math.nan, math.nan, torque, False, activity))
        asked += session.conditioning.take_request()
        if session.state != RUNNING:
            break
    assert (session.state, asked) == (PAUSED, 3)
    assert [event.event for event in events][-3:] == [
        "trial not counted",
        "fault",
        "session paused",
    ]
    assert "EMG processor" in events[-2].details["message"]


def test_a_session_of_a_course_goes_from_control_trials_to_its_end(tmp_path):
    course = load_course(written(tmp_path))
    file = CourseFile(tmp_path / "S07.yaml", course, "S07", pytest.fail)
    file.record.results = baseline_results(course)
    session = Session(next_of_course=file.next_session)
    assert session.step.block == 0
    torque, activity = steady(course)
    now, waiting, events = 0.0, None, []

    def run(until):
        nonlocal now, waiting
        for _ in range(100_000):
            if until():
                return
            now += 1 / 30
            if session.state == PAUSED and session.step.kind == BREAK:
                session.arm(now)
                events.extend(session.start(now))
            responses = ()
            if waiting is not None and now > waiting + 0.2:
                responses, waiting = (Response(waiting, 1.0 + 0.01 * (round(now) % 7)),), None
            reading = Reading(math.nan, math.nan, torque, False, activity, responses)
            events.extend(session.tick(now, reading))
            if session.conditioning.take_request():
                waiting = now + 0.5
            file.keep(session.conditioning.session)
        raise AssertionError("it did not end")

    session.arm(0.0)
    session.start(0.0)
    run(lambda: session.step.block == 2)
    assert session.target.upper == pytest.approx(1e6 * session.conditioning.session.criterion)
    file.close()
    # The computer fails; another one continues in the same block.
    file = CourseFile(tmp_path / "S07.yaml", course, "S07", pytest.fail)
    done = len(session.conditioning.session.trials)
    session = Session(next_of_course=file.next_session)
    assert len(session.conditioning.session.trials) == done
    assert session.step.block == 2
    session.arm(now)
    session.start(now)
    waiting = None
    run(lambda: session.state == FINISHED)
    file.close()
    record = load_record(tmp_path / "S07.yaml")
    assert len(record.results) == course.baseline_sessions + 1
    assert record.results[-1].trials == record.results[-1].planned
    assert 0.0 < record.results[-1].success_rate < 1.0
    assert record.unfinished is None
    rewarded = [event.details["success"] for event in events if "success" in event.details]
    assert sum(rewarded) == round(record.results[-1].success_rate * len(rewarded))
    with pytest.raises(CommandError, match="record of subject 'S07', not of 'S08'"):
        CourseFile(tmp_path / "S07.yaml", course, "S08", pytest.fail)


def baseline_results(course):
    return [
        SessionResult(number, "2026-11-20", 75, 75, 1.0, math.nan, math.nan)
        for number in range(1, course.baseline_sessions + 1)
    ]


def test_a_course_needs_the_largest_contraction_with_emg(tmp_path):
    course = load_course(written(tmp_path))
    assert largest_activity(course, {"mvc_plantarflexion": {"SOL[V]": 2e-4}}) == 2e-4
    with pytest.raises(CommandError, match="do the check 'mvc_plantarflexion' with EMG"):
        largest_activity(course, {"mvc_plantarflexion": {"torque[N.m]": 80.0}})


class RefusingGenerator:
    def __init__(self):
        self.asked, self.refusal = 0, ""

    def give(self):
        self.asked += 1
        self.refusal = "the perturbation generator refuses: signal 'pulse_step' runs by itself"


def test_a_generator_that_refuses_pauses_the_session_and_stops_the_rig(tmp_path):
    course = load_course(written(tmp_path, check_list=[]))
    session = Session(next_of_course=lambda: CourseSession(course, 1))
    rig, generator, events = FakeRig(), RefusingGenerator(), []
    runner = SessionRunner(
        session,
        LiveSignals(),
        rig,
        FakeSubject(),
        events.append,
        lambda: 0.0,
        perturbation=generator,
    )
    session.arm(0.0)
    session.start(0.0)
    rig.present = False
    torque, activity = steady(course)
    reading = Reading(math.nan, math.nan, torque, False, activity)
    for k in range(200):
        session.tick(k / 30, reading)
        runner._follow_perturbation(k / 30)
    assert (session.state, generator.asked) == (PAUSED, 1)
    assert "pulse_step" in next(e.details["message"] for e in events if e.event == "fault")
    assert "stop" in rig.requests
    # An answer that comes late does not end the next start.
    generator.refusal = "late"
    runner._follow_perturbation(7.0)
    session.arm(7.0)
    session.start(7.0)
    runner._follow_perturbation(7.1)
    assert session.state == RUNNING
