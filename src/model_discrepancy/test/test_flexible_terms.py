"""Terms that take many shapes are added where a recording needs several terms, and only there."""

from types import SimpleNamespace

import numpy as np
import pytest

from ankle_physics.model import Model
from ankle_physics.signals import Signals
from model_discrepancy.problem import prepare
from model_discrepancy.search import term_search
from model_discrepancy.search.flexible_terms import add_flexible
from model_discrepancy.search.found import Effect, Found, Trial
from model_discrepancy.search.null import Null
from simulation_study.planted_trials import simulate_trial

UNEVEN = {"e4": 8e-4, "e6": -6e-4, "e8": 9e-4, "e9": -7e-4, "span": 0.06, "xc": 0.0}
YIELDING = {"gap": 0.004, "recovery": 0.2}


def prepared(planted):
    problem = prepare(simulate_trial(planted, seed=6, duration=25.0, protocol="random"))
    fitter = problem.fitter
    return problem, Null.of(problem.noise, fitter.rows.time, fitter.rows.used)


def error_of(values, angles):
    """Return the angle error of a model at some angles, without its straight line."""
    still = np.zeros_like(angles)
    signals = Signals(1000.0, angles, still, still)
    Model.of({"uneven_angle": values}).start(1000.0).torque(signals)
    error = signals.position - angles
    return error - np.polyval(np.polyfit(angles, error, 1), angles)


def test_an_uneven_angle_is_found_with_its_curve():
    problem, null = prepared({"uneven_angle": UNEVEN})
    found = Found(problem.base, problem.base)
    assert add_flexible(problem.fitter, found, ["uneven_angle"], null, print)
    assert found.final.score < 0.8 * problem.base.score
    assert found.compared is problem.base
    assert [effect.trial.name for effect in found.refinements] == ["uneven_angle"]
    angles = np.linspace(-0.02, 0.02, 81) + problem.fitter.columns.mean_angle
    hidden = error_of(UNEVEN, angles)
    stated = error_of(found.final.values["uneven_angle"], angles)
    assert np.corrcoef(stated, hidden)[0, 1] > 0.9
    assert np.std(stated) == pytest.approx(np.std(hidden), rel=0.3)


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
    names = ["recovering_lost_motion", "uneven_angle"]
    assert not add_flexible(problem.fitter, found, names, null, print)
    assert found.final is final
    assert found.compared is final
    assert not found.refinements


@pytest.mark.parametrize(("effects", "tried"), [(3, False), (5, True)])
def test_flexible_terms_are_tried_only_beside_several_terms(effects, tried, monkeypatch):
    asked = []
    monkeypatch.setattr(term_search, "add_flexible", lambda *given: asked.append(given[2]))
    found = SimpleNamespace(effects=[None] * (effects - 1), refinements=[None])
    term_search.complete(None, found, None)
    assert asked == ([["recovering_lost_motion", "uneven_angle"]] if tried else [])
    term_search.complete(None, found, None, library=["uneven_angle", "backlash"])
    assert asked[1:] == ([["uneven_angle"]] if tried else [])
