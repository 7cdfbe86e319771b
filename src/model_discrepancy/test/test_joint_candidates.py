"""Special cases of the terms that several recordings need together."""

from types import SimpleNamespace

import pytest

from ankle_physics.term import term_library
from model_discrepancy.search.screening import with_term
from model_discrepancy.tools.joint_candidates import special_cases_together, specialised
from model_discrepancy.tools.shared_effects import Together

BASE = ("inertia", "viscosity", "stiffness", "reflex")


class FakeFitter:
    """Fits a model to a score that is known for each term."""

    def __init__(self, scores):
        self.scores = scores

    def fit(self, terms, values, evaluations):
        score = min(self.scores.get(term, 100.0) for term in terms)
        return SimpleNamespace(
            terms=list(terms), values={t: dict(values[t]) for t in terms}, score=score
        )


def strapped(special_score, by_chance):
    """Two recordings whose models hold a strap that stiffens."""
    scores = {"stiffening_fixation": 10.0, "fixation_compliance": special_score}
    library = term_library()
    terms = with_term(BASE, "stiffening_fixation")
    values = {t: {p.symbol: 1.0 for p in library[t].parameters} for t in terms}
    fitter = FakeFitter(scores)
    members = [
        SimpleNamespace(
            problem=SimpleNamespace(fitter=fitter), fit=fitter.fit(terms, values, evaluations=1)
        )
        for _ in range(2)
    ]
    return Together(members, by_chance={"stiffening_fixation": by_chance})


def test_a_special_case_is_tried_though_the_screening_does_not_promise_it():
    found = strapped(10.1, 0.02)
    special = special_cases_together(
        found.members, "stiffening_fixation", [m.fit for m in found.members]
    )
    assert list(special) == ["fixation_compliance"]
    assert all("stiffening_fixation" not in one.terms for one in special["fixation_compliance"])


@pytest.mark.parametrize(
    ("special_score", "left"), [(10.1, "fixation_compliance"), (11.0, "stiffening_fixation")]
)
def test_a_special_case_takes_the_place_of_what_gains_no_more_than_chance(special_score, left):
    found = strapped(special_score, 0.02)
    assert specialised(found, {"stiffening_fixation": 0.9}) == {left: 0.9}
    assert all(left in member.fit.terms for member in found.members)
