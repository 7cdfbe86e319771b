"""Terms that take many shapes are added where a recording needs several terms, and only there."""

from types import SimpleNamespace

import numpy as np
import pytest

from ankle_physics.angle_spline import KNOTS
from ankle_physics.model import Model
from ankle_physics.signals import Signals
from model_discrepancy.fit.standard_errors import with_errors
from model_discrepancy.problem import prepare
from model_discrepancy.report.angle_error import angle_curve, angle_error
from model_discrepancy.report.pictures import angle_error_picture
from model_discrepancy.search import flexible_terms, term_search
from model_discrepancy.search.flexible_terms import add_flexible, add_further
from model_discrepancy.search.found import Effect, Found, Trial
from model_discrepancy.search.grids import Grids
from model_discrepancy.search.null import Null
from simulation_study.planted_trials import simulate_trial

FLAT = {f"e{number}": 0.0 for number in range(1, KNOTS + 1)}
UNEVEN = {**FLAT, "e4": 8e-4, "e6": -6e-4, "e8": 9e-4, "e9": -7e-4, "span": 0.06, "xc": 0.0}
YIELDING = {"gap": 0.004, "recovery": 0.2}


def prepared(planted):
    problem = prepare(simulate_trial(planted, seed=6, duration=25.0, protocol="random"))
    fitter = problem.fitter
    return problem, Null.of(problem.noise, fitter.rows.time, fitter.rows.used)


def damping_at(values, angles):
    """Return the torque per velocity that a term adds at some angles [N.m.s/rad]."""
    signals = Signals(1000.0, angles, np.ones_like(angles), np.zeros_like(angles))
    return Model.of({"uneven_damping": values}).torque(signals)


def test_an_uneven_angle_is_found_with_its_curve():
    problem, null = prepared({"uneven_angle": UNEVEN})
    found = Found(problem.base, problem.base)
    assert add_flexible(problem.fitter, found, ["uneven_angle"], null, print)
    assert found.final.score < 0.8 * problem.base.score
    assert found.compared is problem.base
    assert [effect.trial.name for effect in found.refinements] == ["uneven_angle"]
    final = with_errors(problem.fitter, found.final)
    angles, stated, spread = angle_curve(problem.fitter, final)
    hidden = angle_error({"uneven_angle": UNEVEN}, angles)
    assert np.corrcoef(stated, hidden)[0, 1] > 0.9
    assert np.std(stated) == pytest.approx(np.std(hidden), rel=0.3)
    # Knots at other angles than the hidden ones cannot follow its corners.
    assert np.mean(np.abs(stated - hidden) < 3.0 * spread) > 0.7
    assert spread.max() < np.ptp(hidden)
    assert len(angle_error_picture(problem.fitter, final)) > 1000


def test_uneven_damping_is_found_beside_viscosity():
    hidden = {f"b{number}": 0.0 for number in range(1, KNOTS + 1)}
    hidden |= {"b5": 1.2, "b9": -1.2, "span": 0.06, "xc": 0.0}
    problem, null = prepared({"uneven_damping": hidden})
    found = Found(problem.base, problem.base)
    assert add_flexible(problem.fitter, found, ["uneven_damping"], null, print)
    angles = np.linspace(-0.02, 0.02, 81)
    difference = damping_at(found.final.values["uneven_damping"], angles)
    difference = difference - damping_at(hidden, angles)
    assert np.ptp(difference) < 0.2 * np.ptp(damping_at(hidden, angles))
    viscosity = found.final.values["viscosity"]["B"] + difference.mean()
    # The same subject without uneven damping.
    assert viscosity == pytest.approx(prepared({})[0].base.values["viscosity"]["B"], rel=0.05)


def test_a_coupling_that_yields_takes_the_place_of_lost_motion_and_keeps_its_rivals():
    problem, null = prepared({"recovering_lost_motion": YIELDING})
    lost = problem.fitter.fit([*problem.base.terms, "lost_motion"], problem.base.values)
    effect = Effect(Trial("lost_motion", lost, 0.5, (0.5, 0.5), -100.0), np.zeros(2))
    effect.rivals = [Trial("backlash", lost, 0.4, (0.4, 0.4), -80.0)]
    found = Found(problem.base, lost, [effect])
    assert add_flexible(problem.fitter, found, ["recovering_lost_motion"], null, print)
    assert [e.trial.name for e in found.effects] == ["recovering_lost_motion"]
    assert found.effects[0].rivals == effect.rivals
    assert "lost_motion" not in found.final.terms
    values = found.final.values["recovering_lost_motion"]
    assert values["gap"] == pytest.approx(YIELDING["gap"], rel=0.15)
    # The position's noise lets the spring forget, too, so that less is left to the recovery.
    assert YIELDING["recovery"] < values["recovery"] < 2.5 * YIELDING["recovery"]


def test_nothing_flexible_is_added_to_a_recording_that_holds_nothing_of_it():
    problem, null = prepared({"maxwell_relaxation": {"k": 40.0, "T": 0.05}})
    terms = [*problem.base.terms, "maxwell_relaxation"]
    final = problem.fitter.fit(terms, problem.base.values)
    found = Found(problem.base, final)
    names = ["recovering_lost_motion", "uneven_angle", "uneven_damping"]
    assert not add_flexible(problem.fitter, found, names, null, print)
    assert found.final is final
    assert found.compared is final
    assert not found.refinements


@pytest.mark.parametrize(
    ("library", "left"),
    [(["maxwell_relaxation"], ["maxwell_relaxation"]), (["stiffness_drift"], [])],
)
def test_a_further_term_is_added_where_it_predicts_unseen_data_better(library, left):
    problem, null = prepared({"maxwell_relaxation": {"k": 40.0, "T": 0.05}})
    found = Found(problem.base, problem.base)
    add_further(problem.fitter, found, Grids(library, 25.0), null, print)
    assert [effect.trial.name for effect in found.refinements] == left
    assert (found.final.score < 0.9 * problem.base.score) == bool(left)


@pytest.mark.parametrize(
    ("held_out", "by_chance", "taken"),
    [((0.05, 0.04), 0.01, True), ((0.05, 0.01), 0.01, False), ((0.05, 0.04), 0.2, False)],
)
def test_a_further_term_needs_both_halves_and_more_than_chance_but_no_torque(
    held_out, by_chance, taken, monkeypatch
):
    problem, null = prepared({"maxwell_relaxation": {"k": 40.0, "T": 0.05}})
    fit = problem.fitter.fit([*problem.base.terms, "maxwell_relaxation"], problem.base.values)
    trial = Trial("maxwell_relaxation", fit, 0.1, held_out, -50.0, by_chance, torque_share=0.0)
    offered = [[trial], []]
    candidates = SimpleNamespace(best=lambda _: (offered.pop(0), 0.0))
    monkeypatch.setattr(flexible_terms, "Candidates", lambda *_: candidates)
    found = Found(problem.base, problem.base)
    add_further(problem.fitter, found, None, null, print)
    assert (found.final is not problem.base) == taken
    assert [effect.trial for effect in found.refinements] == [trial] * taken


@pytest.mark.parametrize(
    ("many", "seconds", "tried"), [(False, 60.0, False), (True, 30.0, False), (True, 60.0, True)]
)
def test_flexible_terms_are_tried_beside_several_terms_of_a_long_recording(
    many, seconds, tried, monkeypatch
):
    asked = []
    monkeypatch.setattr(term_search, "add_flexible", lambda *given: asked.append(given[2]))
    fitter = SimpleNamespace(rows=SimpleNamespace(count=round(200 * seconds), rate=200.0))
    found = SimpleNamespace(needs_many_terms=many, effects=[])
    term_search.complete(fitter, found, None)
    every = ["recovering_lost_motion", "uneven_angle", "uneven_damping"]
    assert asked == ([every] if tried else [])
    term_search.complete(fitter, found, None, library=["uneven_angle", "backlash"])
    assert asked[1:] == ([["uneven_angle"]] if tried else [])
