"""Standard errors of K and G hold where the equations are not quite those of the joint."""

from types import SimpleNamespace

import pytest

from ankle_physics.impedance import OperatingPoint
from model_discrepancy.report.operating_point import (
    ENGINE_SHARE,
    EQUATION_SHARE,
    with_model_error,
)
from model_discrepancy.search.found import Effect, Found, Trial

KEY = "K[N.m/rad]"
STATED = {KEY: (100.0, 1.0), "B[N.m.s/rad]": (1.0, None)}


def fit(stiffness, score=1.0):
    return SimpleNamespace(values={"stiffness": {"K": stiffness}}, score=score)


def error_of(found):
    return with_model_error(STATED, found, OperatingPoint())[KEY][1]


def test_without_a_mismatch_the_engines_difference_remains():
    alone = error_of(Found(fit(100.0), fit(100.0)))
    assert alone == pytest.approx((1.0 + (100.0 * ENGINE_SHARE["K"]) ** 2) ** 0.5)


def test_what_the_terms_changed_widens_the_error():
    wider = error_of(Found(fit(60.0), fit(100.0)))
    assert wider > EQUATION_SHARE * 40.0


def test_a_rival_that_fits_as_well_widens_the_error_by_its_distance():
    final = fit(100.0)
    rival = Trial("tendon", fit(120.0), 0.5, (0.5, 0.5), -10.0)
    effect = Effect(Trial("maxwell_relaxation", final, 0.5, (0.5, 0.5), -10.0), errors=None)
    alone = error_of(Found(fit(100.0), final, effects=[effect]))
    effect.rivals = [rival]
    with_rival = error_of(Found(fit(100.0), final, effects=[effect]))
    assert with_rival**2 - alone**2 == pytest.approx(0.5 * 20.0**2)
    effect.rivals = [Trial("tendon", fit(120.0, score=1.1), 0.5, (0.5, 0.5), -10.0)]
    assert error_of(Found(fit(100.0), final, effects=[effect])) == pytest.approx(alone, rel=0.01)


def test_a_near_miss_that_criticises_the_model_widens_the_error():
    near = Trial("tendon", fit(110.0), 0.1, (0.1, 0.1), -10.0, by_chance=0.01)
    assert error_of(Found(fit(100.0), fit(100.0), near=[near])) > 5.0


def test_an_error_that_nobody_knows_stays_unknown():
    found = Found(fit(60.0), fit(100.0))
    assert with_model_error(STATED, found, OperatingPoint())["B[N.m.s/rad]"] == (1.0, None)
