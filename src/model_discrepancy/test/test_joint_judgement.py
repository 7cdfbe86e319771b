"""What all recordings say together of open sets: it replaces, questions or withdraws their names,
and the investigation goes on where it leaves something to ask.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from model_discrepancy.tools import investigation, joint_judgement
from model_discrepancy.tools.investigation import Round, investigate
from model_discrepancy.tools.joint_candidates import Rivals
from model_discrepancy.tools.joint_judgement import Judgement, judge_together, settle_doubts
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

    fitter = SimpleNamespace(rows=SimpleNamespace(independent=1000.0), fit=fitted)
    return SimpleNamespace(problem=SimpleNamespace(fitter=fitter))


@pytest.mark.parametrize(
    ("share", "gains", "left"),
    [(0.1, (0.2, 0.0), []), (0.1, (0.0, 0.2), list(OLD)), (0.01, (0.0, 0.2), [])],
)
def test_names_that_no_designed_recording_needs_or_that_only_refine_are_withdrawn(
    searched, share, gains, left
):
    """What all recordings confirm may be what the first one alone needs."""
    searched({"inertia": 0.9, "tendon": share}, "explained")
    joint_judgement.diagnose_together().members.extend(recorded(gain) for gain in gains)
    one = open_set()
    judge_together([one], [], beside={"inertia": {}})
    assert one.left == left


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

    def made(asks, recorded=True, rounds=3):
        effects = [{"name": "tendon"}]
        diagnosis = SimpleNamespace(
            verdict=SimpleNamespace(verdict="explained", effects=effects, parameters={}),
            found=SimpleNamespace(final=fit("tendon")),
        )
        monkeypatch.setattr(investigation, "diagnose", lambda *_, **__: diagnosis)
        monkeypatch.setattr(investigation, "_open_sets", lambda _: [open_set()])
        searches = []

        def next_round(story, *_):
            if len(story.recordings) > story.searched or len(story.rounds) >= rounds:
                return "nothing more tells"
            story.rounds.append(Round("", "", "steps", 60.0 if recorded else 0.0, ""))
            story.recordings.append(SimpleNamespace(name="next"))
            return ""

        def judge(*_):
            searches.append(1)
            return Judgement("said.", asks)

        monkeypatch.setattr(investigation, "_next_round", next_round)
        monkeypatch.setattr(investigation, "judge_together", judge)
        first = object.__new__(investigation.Recording)
        object.__setattr__(first, "name", "first")
        return investigate(first, lambda *_: None, tmp_path, rounds), len(searches)

    return made


@pytest.mark.parametrize(("asks", "searches"), [(True, 3), (False, 1)])
def test_it_goes_on_while_the_search_of_all_recordings_asks_and_the_budget_lasts(
    story_of, asks, searches
):
    story, searched = story_of(asks)
    assert searched == len(story.rounds) == searches
    assert story.ended == "nothing more tells"


def test_it_does_not_go_on_without_consent(story_of):
    story, searched = story_of(True, recorded=False)
    assert searched == len(story.rounds) == 1
