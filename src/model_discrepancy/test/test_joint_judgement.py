"""What all recordings say together of open sets: it replaces, questions or withdraws their names,
and the investigation goes on where it leaves something to ask.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from model_discrepancy.recording.torque_reading import TorqueReading
from model_discrepancy.tools import investigation, joint_judgement
from model_discrepancy.tools.candidate_movements import Candidate
from model_discrepancy.tools.experiment_design import Design
from model_discrepancy.tools.investigation import Round, investigate
from model_discrepancy.tools.joint_candidates import Rivals
from model_discrepancy.tools.joint_judgement import Judgement, judge_together, settle_doubts
from model_discrepancy.tools.movement_ranking import Proposal, RivalSet
from model_discrepancy.tools.open_set import OpenSet

BASE = ("inertia", "viscosity", "stiffness", "reflex")
OLD = ("tendon", "reflex_threshold")


def fit(*names, score=100.0):
    terms = [*BASE, *names]
    return SimpleNamespace(terms=terms, values={term: {} for term in terms}, score=score)


def open_set():
    return OpenSet("tendon", {name: fit(name).values for name in OLD})


@pytest.fixture
def searched(monkeypatch):
    """Let a search of all recordings find given shares, beside names that fit as well or not."""

    def searches(shares, verdict, worse=False, rivals=("reflex_exponent",)):
        found = SimpleNamespace(
            effects=[SimpleNamespace(name=name, share=share) for name, share in shares.items()],
            named=[SimpleNamespace(name=name) for name in shares],
            verdict=verdict,
            members=[],
        )
        zero = {name: [0.0, 0.0] for name in rivals}
        models = {name: [fit(name), fit(name)] for name in rivals}
        errors = {name: [np.ones(4), np.ones(4)] for name in rivals}
        tried = Rivals(models, zero, dict.fromkeys(rivals, 0.0), errors)
        monkeypatch.setattr(joint_judgement, "diagnose_together", lambda *_, **__: found)
        monkeypatch.setattr(joint_judgement, "rivals_together", lambda *_: tried)
        monkeypatch.setattr(joint_judgement, "_worse", lambda *_: worse)

    return searches


def test_what_is_named_instead_and_fits_as_well_is_put_beside_the_names(searched):
    searched({"reflex_exponent": 0.9}, "unexplained")
    one = open_set()
    judged = judge_together([one], [])
    assert judged.asks
    assert one.left == ["reflex_exponent", *OLD]
    assert one.doubted == list(OLD)
    assert one.names == list(OLD)
    # What was chosen on the recordings so far says nothing more.
    assert one.excess == one.evidence == one.errors == {}
    assert "reflex exponent is named instead of tendon or reflex threshold" in judged.sentence


def test_what_is_named_instead_and_is_likelier_takes_the_place_of_the_names(searched):
    searched({"reflex_exponent": 0.9}, "explained", worse=True)
    one = open_set()
    assert not judge_together([one], []).asks
    assert one.left == ["reflex_exponent"]
    searched({"reflex_exponent": 0.9}, "explained", True, ("reflex_exponent", "reflex_drift"))
    one = open_set()
    assert judge_together([one], []).asks
    assert one.left == ["reflex_exponent", "reflex_drift"]


@pytest.mark.parametrize(("share", "left"), [(0.1, ["reflex_exponent"]), (0.3, list(OLD))])
def test_what_is_named_beside_a_set_in_similar_size_does_not_take_its_place(searched, share, left):
    searched({"reflex_exponent": 1.0 - share, "tendon": share}, "explained", worse=True)
    one = open_set()
    judge_together([one], [])
    assert one.left == left


def test_a_stand_in_of_what_is_not_explained_takes_no_place(searched):
    searched({"inertia": 0.6, "reflex_exponent": 0.4}, "unexplained", worse=True)
    one = open_set()
    judge_together([one], [], beside={"inertia": {}})
    assert one.left == []


def test_the_search_begins_once_more_from_what_is_left(searched, monkeypatch):
    searched({"reflex_threshold": 1.0}, "explained")
    begun = []
    found = joint_judgement.diagnose_together()

    def search(*_, begin, **__):
        begun.append(begin)
        return found

    monkeypatch.setattr(joint_judgement, "diagnose_together", search)
    one = open_set()
    one.models["reflex_threshold"]["reflex_threshold"] = {"vt": 0.2}
    one.left = ["reflex_threshold"]
    judge_together([one], [], beside={"inertia": {"I": 0.01}})
    assert begun == [{"inertia": {"I": 0.01}, "reflex_threshold": {"vt": 0.2}}]


def test_names_that_nothing_confirms_are_withdrawn_where_no_new_effect_is_named(searched):
    searched({"reflex_exponent": 0.9, "tendon": 0.01}, "unexplained")
    one = open_set()
    assert not judge_together([one], [], beside={"reflex_exponent": {}}).asks
    assert one.left == []


def recorded(gain):
    """Return a recording of which either name of the open set takes this share off the error."""

    def fitted(terms, *_, **__):
        return SimpleNamespace(
            terms=terms, score=1.0 - gain * bool(set(OLD) & set(terms)), size=len(terms)
        )

    fitter = SimpleNamespace(
        rows=SimpleNamespace(independent=1000.0, count=6000, rate=100.0),
        fit=fitted,
        start_values=lambda names, start: {name: {} for name in names},
        solve=fitted,
    )
    return SimpleNamespace(problem=SimpleNamespace(fitter=fitter))


@pytest.mark.parametrize(
    ("share", "gains", "left"),
    [(0.1, (0.2, 0.0), []), (0.1, (0.0, 0.2), list(OLD)), (0.01, (0.0, 0.2), [])],
)
def test_names_that_no_designed_recording_needs_or_that_only_refine_are_withdrawn(
    searched, share, gains, left, monkeypatch
):
    """What all recordings confirm may be what the first one alone needs."""
    monkeypatch.setattr("model_discrepancy.tools.open_set.align", lambda _, fit: fit)
    searched({"inertia": 0.9, "tendon": share}, "explained")
    joint_judgement.diagnose_together().members.extend(recorded(gain) for gain in gains)
    one = open_set()
    judge_together([one], [], beside={"inertia": {}})
    assert one.left == left


@pytest.mark.parametrize(
    ("share", "verdict", "left"),
    [
        (0.9, "explained", ["reflex_exponent"]),
        (0.04, "explained", []),
        (0.4, "unexplained", []),
    ],
)
def test_what_more_recordings_name_and_confirm_takes_the_place_of_nothing(
    searched, share, verdict, left
):
    searched({"inertia": 1.0 - share, "reflex_exponent": share}, verdict)
    one = open_set()
    one.left = []
    judged = judge_together([one], [], beside={"inertia": {}})
    assert one.left == left
    assert ("is named where nothing was left" in judged.sentence) == bool(left)
    assert not judged.asks


def test_what_more_recordings_name_must_be_needed_by_a_designed_one(searched, monkeypatch):
    searched({"reflex_exponent": 1.0}, "explained")
    monkeypatch.setattr(joint_judgement, "_needless", lambda *_: True)
    one = open_set()
    one.left = []
    judge_together([one], [])
    assert one.left == []


def test_a_name_that_only_refines_a_model_does_not_question_a_set(searched):
    searched({"inertia": 0.6, "tendon": 0.36, "reflex_exponent": 0.04}, "explained")
    one = open_set()
    assert not judge_together([one], [], beside={"inertia": {}}).asks
    assert one.left == list(OLD)


def test_a_question_that_no_recording_decides_states_neither_side(searched):
    searched({"reflex_exponent": 0.9}, "unexplained")
    undecided, decided = open_set(), open_set()
    judge_together([undecided], [])
    judge_together([decided], [])
    decided.left = ["reflex_exponent"]
    assert "no recording decides" in settle_doubts([undecided, decided])
    assert undecided.left == []
    assert decided.left == ["reflex_exponent"]


def test_a_doubted_name_is_fitted_without_the_one_that_was_put_beside_it(searched):
    one = open_set()
    one.models["tendon"]["reflex_exponent"] = {"p": 0.5}
    searched({"reflex_exponent": 0.9}, "unexplained")
    judge_together([one], [])
    assert "reflex_exponent" in one.model("reflex_exponent")
    assert "reflex_exponent" not in one.model("tendon")
    assert "tendon" in one.model("tendon")


@pytest.fixture
def story_of(monkeypatch, tmp_path):
    """Return an investigation whose rounds and joint searches are counted and not made."""

    def made(asks, recorded=True, rounds=3, withdraws=False):
        effects = [{"name": "tendon"}]
        diagnosis = SimpleNamespace(
            verdict=SimpleNamespace(verdict="explained", effects=effects, parameters={}),
            found=SimpleNamespace(final=fit("tendon")),
            problem=SimpleNamespace(reading=TorqueReading()),
        )
        monkeypatch.setattr(investigation, "diagnose", lambda *_, **__: diagnosis)
        monkeypatch.setattr(investigation, "open_sets", lambda _: [open_set()])
        searches = []

        def next_round(story, *_):
            if len(story.recordings) > story.searched or len(story.rounds) >= rounds:
                return "nothing more tells"
            story.rounds.append(Round("", "", "steps", 60.0 if recorded else 0.0, ""))
            story.recordings.append(SimpleNamespace(name="next"))
            return ""

        def judge(sets, *_):
            searches.append(1)
            if withdraws:
                sets[0].left = [] if len(searches) == 1 else ["reflex_exponent"]
            return Judgement("said.", asks)

        monkeypatch.setattr(investigation, "_next_round", next_round)
        monkeypatch.setattr(investigation, "judge_together", judge)
        first = object.__new__(investigation.Recording)
        object.__setattr__(first, "name", "first")
        return investigate(first, lambda *_: None, tmp_path, rounds), len(searches)

    return made


@pytest.mark.parametrize(
    ("asks", "searches", "ended"),
    [(True, 3, "The budget of 3 recordings is spent."), (False, 1, "nothing more tells")],
)
def test_it_goes_on_while_the_search_of_all_recordings_asks_and_the_budget_lasts(
    story_of, asks, searches, ended
):
    story, searched = story_of(asks)
    assert searched == len(story.rounds) == searches
    assert story.ended == ended


def test_it_does_not_go_on_without_consent(story_of):
    story, searched = story_of(True, recorded=False)
    assert searched == len(story.rounds) == 1


def test_it_goes_on_where_a_set_was_withdrawn_until_something_is_named(story_of):
    story, searched = story_of(False, withdraws=True)
    assert searched == len(story.rounds) == 2
    assert story.names == ["reflex_exponent"]
    assert story.ended == "Each effect has one name."


@pytest.mark.parametrize(
    ("left", "effects", "ended"),
    [
        (["tendon"], ["tendon"], "Each effect has one name."),
        ([], ["tendon", "inertia"], "Each effect that is left has one name."),
        (list(OLD), ["tendon"], "The budget of 1 recording is spent."),
        ([], ["tendon"], "The budget of 1 recording is spent."),
    ],
)
def test_why_it_ended_is_said_of_what_the_search_of_all_recordings_left(left, effects, ended):
    verdict = SimpleNamespace(effects=[{"name": name} for name in effects])
    one = open_set()
    one.left = left
    story = investigation.Investigation(SimpleNamespace(verdict=verdict), [one])
    story.rounds, story.ended = [Round("", "", "steps", 60.0, "")], "what the round before said"
    assert investigation._ending(story, 1) == ended
    story.rounds = [Round("", "", "steps", 0.0, "")]
    assert investigation._ending(story, 1) == "what the round before said"


@pytest.fixture
def withdrawn(monkeypatch):
    """Return an investigation whose only set was withdrawn, and the design that is asked for."""
    asked = []

    def design(_, sets, *__):
        asked.extend(name for one in sets for name in one.models)
        pairs = {(OLD[0], OLD[1]): 0.2, (OLD[1], OLD[0]): 0.2}
        proposal = Proposal(Candidate("steps", {}), 0.2, 1.0, OLD, pairs, True)
        return Design([RivalSet({name: {} for name in OLD}, 0.0)], [proposal], [])

    monkeypatch.setattr(investigation, "_design", design)
    monkeypatch.setattr(investigation, "faults", lambda _: [])
    one = open_set()
    one.left = []
    recording = SimpleNamespace(name="made", duration=60.0)
    story = investigation.Investigation(None, [one], recordings=[recording], searched=1)
    story.rounds = [Round("", "", "sines", 60.0, "", judged=True)]
    return story, recording, asked


def test_where_no_name_is_left_a_movement_is_made_that_tells_the_stand_ins_apart(
    withdrawn, tmp_path
):
    story, recording, asked = withdrawn

    def next_round(rounds):
        return investigation._next_round(
            story, lambda *_: recording, tmp_path, rounds, lambda _: None
        )

    assert "budget of 1 recording is spent" in next_round(1)
    assert next_round(3) == ""
    assert tuple(asked) == OLD
    assert story.recordings == [recording, recording]
    assert "none of tendon, reflex threshold holds" in story.rounds[-1].question
    # One at a time: it is searched together with the others before the next one is made.
    assert next_round(3) == "All recordings are searched together."
    assert len(story.recordings) == 2
    story.searched = 2
    story.sets[0].models = {"tendon": {}}
    assert next_round(3) == "No name is left to ask about."
