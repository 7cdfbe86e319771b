"""Standard errors of K and G hold where the equations are not quite those of the joint."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ankle_physics.errors import ModelError
from ankle_physics.foot_loop import FootLoop
from ankle_physics.impedance import OperatingPoint, reflex_gain
from ankle_physics.model import Model
from model_discrepancy.criticism.remainder import Remainder
from model_discrepancy.fit.movements import Onsets
from model_discrepancy.recording.motion import Motion
from model_discrepancy.report.operating_point import (
    DOUBTED_EQUATION_SHARE,
    EFFECT_SHARE,
    ENGINE_SHARE,
    EQUATION_SHARE,
    LEAST_EQUATION_SHARE,
    REFLEX_SHAPE_SHARE,
    UNEXPLAINED_SHARE,
    equation_misfit,
    operating_point,
    stated_impedance,
    with_model_error,
)
from model_discrepancy.report.verdict import before_and_after
from model_discrepancy.search.found import Effect, Found, Trial

KEY = "K[N.m/rad]"
STATED_IMPEDANCE = {KEY: (100.0, 1.0), "B[N.m.s/rad]": (1.0, None)}


def fit(stiffness, score=1.0, at_bounds=()):
    values = {"stiffness": {"K": stiffness}}
    return SimpleNamespace(values=values, terms=tuple(values), score=score, at_bounds=at_bounds)


def error_of(found):
    return with_model_error(STATED_IMPEDANCE, found, OperatingPoint())[KEY][1]


def test_g_is_that_of_the_recorded_movement():
    """Slow swings hardly pass a threshold that steps of their size would."""
    rate, size, swings = 500.0, 0.05, 2.0 * np.pi
    angle = swings * np.arange(round(30.0 * rate)) / rate
    x, v, a = size * np.sin(angle), size * swings * np.cos(angle), -size * swings**2 * np.sin(angle)
    motion = Motion(rate, x, v, a, np.zeros_like(x), np.zeros_like(x))
    onsets = Onsets(np.arange(1.0, 29.0), np.ones(28), np.full(28, size))
    model = Model.of({"reflex": {"G": 10.0}, "reflex_threshold": {"vt": 0.2}})
    at = operating_point(motion, onsets)
    met = np.maximum(v - 0.2, 0.0).sum() / np.maximum(v, 0.0).sum()
    assert reflex_gain(model, at) == pytest.approx(10.0 * met, rel=0.02)
    assert reflex_gain(model, replace(at, movement=None)) > 15.0 * met


def test_without_a_mismatch_the_engines_difference_remains():
    alone = error_of(Found(fit(100.0), fit(100.0)))
    assert alone == pytest.approx((1.0 + (100.0 * ENGINE_SHARE["K"]) ** 2) ** 0.5)


def test_what_the_terms_changed_widens_the_error():
    wider = error_of(Found(fit(60.0), fit(100.0)))
    assert wider > EQUATION_SHARE * 40.0


LEFT = Remainder(0.001, 0.0, {}, 0.0, by_chance=0.005)


def test_equations_that_leave_nothing_widen_the_error_less():
    base, final = fit(300.0), fit(100.0)
    found = Found(base, final, effects=[effect("maxwell_relaxation")], base_score=200.0)

    def width(found, after):
        misfit = equation_misfit(found, after)
        stated = {KEY: (100.0, 0.0)}
        error = with_model_error(stated, found, OperatingPoint(), misfit=misfit)[KEY][1]
        return math.sqrt(
            error**2 - (ENGINE_SHARE["K"] * 100.0) ** 2 - (EFFECT_SHARE["K"] * 100.0) ** 2
        )

    # 2 % of the residual may be predictable unseen: 1 % of the torque that the term explains.
    assert equation_misfit(found, LEFT) == pytest.approx(math.sqrt(0.02 / 199.0))
    assert width(found, LEFT) == pytest.approx(LEAST_EQUATION_SHARE * 200.0)
    assert width(replace(found, base_score=1.5), LEFT) == pytest.approx(EQUATION_SHARE * 200.0)
    much = replace(found, base_score=20.0), replace(LEFT, share=0.2)
    assert width(*much) == pytest.approx(math.sqrt(0.2 / 19.0) * 200.0)
    for told in (
        (found, replace(LEFT, judged=False)),
        (replace(found, refinements=[effect("tendon")]), LEFT),
        (replace(found, effects=[effect("tendon")] * 20), LEFT),
        (replace(found, effects=[]), LEFT),
    ):
        assert equation_misfit(*told) == 1.0


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


def test_another_hypothesis_that_leaves_as_little_widens_the_error_by_its_distance():
    alone, beside = (
        error_of(Found(fit(100.0), fit(100.0), other_models=others))
        for others in ([], [fit(140.0)])
    )
    # Both are equally likely: half of the distance's square.
    assert beside == pytest.approx(math.hypot(alone, 40.0 / 2**0.5))


def test_an_effect_in_doubt_widens_the_error_by_what_it_changed():
    found, without = Found(fit(100.0), fit(100.0)), fit(60.0)

    def variance(tentative):
        stated = with_model_error(STATED_IMPEDANCE, found, OperatingPoint(), tentative=tentative)
        return stated[KEY][1] ** 2

    # In three of four such recordings the model without it is wrong.
    assert variance([(0.75, without)]) - variance([]) == pytest.approx(0.25 * 40.0**2)
    assert variance([(0.75, fit(100.0))]) == pytest.approx(variance([]))


def test_an_error_that_nobody_knows_stays_unknown():
    found = Found(fit(60.0), fit(100.0))
    assert with_model_error(STATED_IMPEDANCE, found, OperatingPoint())["B[N.m.s/rad]"] == (
        1.0,
        None,
    )


def effect(name):
    return Effect(Trial(name, fit(100.0), 0.5, (0.5, 0.5), -10.0), errors=None)


def test_equations_of_the_reflex_widen_the_error_of_its_gain_most():
    stated = {KEY: (100.0, 0.0), "G[N.m.s/rad]": (10.0, 0.0)}
    final = fit(100.0)
    widths = {
        name: with_model_error(
            stated, Found(final, final, effects=[effect(name)]), OperatingPoint()
        )
        for name in ("maxwell_relaxation", "reflex_saturation")
    }
    for name in widths:
        assert widths[name][KEY][1] >= 100.0 * EFFECT_SHARE["K"]
    intrinsic, reflex = (widths[name]["G[N.m.s/rad]"][1] for name in widths)
    assert reflex**2 - intrinsic**2 == pytest.approx((10.0 * REFLEX_SHAPE_SHARE) ** 2)


def test_something_missing_widens_the_error():
    found = Found(fit(100.0), fit(100.0))
    assert with_model_error(STATED_IMPEDANCE, found, OperatingPoint(), missing=True)[KEY][1] > (
        100.0 * UNEXPLAINED_SHARE["K"]
    )


@pytest.mark.parametrize(("unexplained", "at_bounds"), [(True, ()), (False, ("stiffness.K",))])
def test_equations_that_something_stands_against_may_be_wrong_by_half_of_what_they_changed(
    unexplained, at_bounds
):
    found = Found(fit(60.0), fit(100.0, at_bounds=at_bounds))
    wider = with_model_error(STATED_IMPEDANCE, found, OperatingPoint(), unexplained)[KEY][1]
    assert wider == pytest.approx(DOUBTED_EQUATION_SHARE * 40.0, rel=0.01)


@pytest.mark.parametrize(
    ("at_bounds", "doubted"),
    [
        ((), False),
        (("reflex.delay",), True),
        (("reflex.z",), True),
        # What a reflex without torque looks like says nothing.
        (("reflex.delay", "reflex.G"), False),
        (("torque_sensor_lag.T",), False),
    ],
)
def test_a_reflex_that_ends_at_a_bound_makes_its_gain_doubtful(at_bounds, doubted):
    stated = {KEY: (100.0, 0.0), "G[N.m.s/rad]": (10.0, 0.0)}
    inside, at_bound = (
        with_model_error(stated, Found(final, final), OperatingPoint())
        for final in (fit(100.0), fit(100.0, at_bounds=at_bounds))
    )
    added = at_bound["G[N.m.s/rad]"][1] ** 2 - inside["G[N.m.s/rad]"][1] ** 2
    assert added == pytest.approx((10.0 * UNEXPLAINED_SHARE["G"]) ** 2 if doubted else 0.0)
    assert at_bound[KEY] == inside[KEY]


def test_what_refinements_changed_widens_the_error():
    found = Found(fit(100.0), fit(100.0), unrefined=fit(160.0))
    assert error_of(found) == pytest.approx((0.5 * 60.0**2) ** 0.5, rel=0.01)


def test_what_friction_may_hold_at_rest_widens_the_error_of_the_stiffness():
    found = Found(fit(100.0), fit(100.0))
    stated = {**STATED_IMPEDANCE, "G[N.m.s/rad]": (10.0, 0.1)}
    plain, wider = (
        with_model_error(stated, found, OperatingPoint(), at_rest=error) for error in (0.0, 14.0)
    )
    assert wider[KEY][1] ** 2 - plain[KEY][1] ** 2 == pytest.approx(14.0**2)
    assert wider["G[N.m.s/rad]"] == plain["G[N.m.s/rad]"]


MASSLESS_FOOT = {
    "inertia": {"I": 1e-7},
    "viscosity": {"B": 1.0},
    "stiffness": {"K": 900.0, "x0": 0.0},
    "fixation_compliance": {"k_s": 300.0, "b_s": 0.1},
    "maxwell_relaxation": {"k": 5000.0, "T": 0.3},
}


# Each sample is solved by itself: half a minute of one core.
@pytest.mark.slow
def test_a_foot_that_is_next_to_massless_is_springs_in_series():
    fit = SimpleNamespace(values=MASSLESS_FOOT, draws={})
    stated = stated_impedance(fit, OperatingPoint())
    assert stated[KEY][0] == pytest.approx(900.0, rel=0.01)
    in_series = 1.0 / (1.0 / 300.0 + 1.0 / (900.0 + 5000.0))
    assert stated["K_effective[N.m/rad]"][0] == pytest.approx(in_series, rel=0.01)


def test_a_foot_whose_simulation_does_not_converge_has_no_effective_stiffness(monkeypatch):
    def runs_away(*_):
        raise ModelError("the foot's motion does not converge")

    monkeypatch.setattr(FootLoop, "run", runs_away)
    stated = stated_impedance(SimpleNamespace(values=MASSLESS_FOOT, draws={}), OperatingPoint())
    assert stated[KEY][0] == pytest.approx(900.0, rel=0.01)
    assert math.isnan(stated["K_effective[N.m/rad]"][0])
    shown = before_and_after(stated, stated)
    assert KEY in shown
    assert "K_effective[N.m/rad]" not in shown
