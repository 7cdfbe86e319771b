"""One term takes the place of two that share what it explains."""

from types import SimpleNamespace

import pytest

from model_discrepancy.search import one_for_two as module
from model_discrepancy.search.found import Effect, Found, Trial
from model_discrepancy.search.one_for_two import one_for_two

BASE = ("inertia", "viscosity", "stiffness", "reflex")
BY_CHANCE = 0.02


def fit_of(score, *names):
    return SimpleNamespace(terms=[*BASE, *names], values={}, score=score, size=len(names))


def effect_of(name, *rivals):
    trial = Trial(name, fit_of(100.0, name), 0.5, (0.5, 0.5), -1.0)
    return Effect(trial, errors=None, rivals=list(rivals))


def rival_of(name, *others):
    return Trial(name, fit_of(99.0, *others, name), 0.5, (0.5, 0.5), -1.0)


@pytest.fixture
def found():
    """A power of the speed stands beside friction as a rival of a damping that levels off."""
    friction = effect_of("coulomb_friction")
    damping = effect_of("saturating_damping", rival_of("power_damping", "coulomb_friction"))
    final = fit_of(100.0, "coulomb_friction", "saturating_damping")
    return Found(fit_of(200.0), final, effects=[friction, damping])


@pytest.fixture
def tried(monkeypatch):
    """Return a function that tries with a score of the rival alone."""
    fitter = SimpleNamespace(
        rows=SimpleNamespace(independent=1000),
        fit_below=lambda terms, *_: fit_of(fitter.alone, *terms[len(BASE) :]),
    )
    null = SimpleNamespace(threshold_of=lambda name, fit: BY_CHANCE)
    monkeypatch.setattr(module, "bic_change", lambda *_: -1.0)

    def run(found, alone, harmful=False):
        monkeypatch.setattr(module, "harms", lambda *_: harmful)
        fitter.alone = alone
        return one_for_two(fitter, found, null, lambda _: None)

    return run


def names(effects):
    return [effect.trial.name for effect in effects]


def test_the_rival_beside_which_the_other_term_is_superfluous_takes_the_place_of_both(found, tried):
    effect, rival = tried(found, 101.0)
    assert (effect.trial.name, rival.name) == ("saturating_damping", "power_damping")
    assert rival.fit.terms == [*BASE, "power_damping"]
    assert names(found.effects) == ["saturating_damping"]


def test_a_refinement_may_be_superfluous_too(found, tried):
    found.refinements = [found.effects.pop(0)]
    assert tried(found, 101.0) is not None
    assert found.refinements == []


def test_the_other_term_stays_where_it_takes_off_more_than_by_chance(found, tried):
    assert tried(found, 103.0) is None
    assert len(found.effects) == 2


def test_the_other_term_stays_where_unseen_torque_would_be_predicted_worse(found, tried):
    assert tried(found, 101.0, harmful=True) is None
    assert len(found.effects) == 2


def test_many_terms_stand_in_for_parts_of_others(found, tried):
    found.refinements = [effect_of("tendon"), effect_of("backlash"), effect_of("thixotropy")]
    assert tried(found, 101.0) is None
