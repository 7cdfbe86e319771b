"""The fit finds the parameters that made the data, with errors of the right size, whatever the
sampling rate.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from ankle_physics.joint_profile import JointProfile, joint_in_force
from ankle_physics.signals import Signals
from ankle_physics.term import Place, term_library
from model_discrepancy.fit import projection, standard_errors
from model_discrepancy.fit.base_model import fit_base, has_joint
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.least_squares import bounded, orthonormal
from model_discrepancy.fit.parameter_scale import (
    absent_parts,
    at_bounds,
    from_unit,
    limit_cases,
    ranges,
    to_unit,
)
from model_discrepancy.fit.projection import Projection
from model_discrepancy.fit.rows import autoregression
from model_discrepancy.fit.standard_errors import with_errors
from model_discrepancy.recording.motion import motion_of
from model_discrepancy.search.screening import grid, screen
from simulation_study.planted_trials import simulate_trial

JOINT = {
    "inertia": {"I": 0.0137},
    "viscosity": {"B": 0.8},
    "stiffness": {"K": 90.0},
    "reflex": {"G": 9.0, "delay": 0.04, "omega": 21.0, "z": 0.8},
}


def fitter_of(recording):
    motion = motion_of(recording)
    return Fitter.of(motion)


@pytest.mark.parametrize(("rate", "velocity"), [(2048.0, True), (1024.0, False)])
def test_base_parameters_come_back(rate, velocity):
    fitter = fitter_of(simulate_trial(JOINT, seed=3, duration=40.0, rate=rate, velocity=velocity))
    fit = with_errors(fitter, fit_base(fitter))
    for name, symbol, tolerance in (
        ("inertia", "I", 0.01),
        ("viscosity", "B", 0.02),
        ("stiffness", "K", 0.02),
        ("reflex", "G", 0.04),
        ("reflex", "delay", 0.03),
    ):
        assert fit.values[name][symbol] == pytest.approx(JOINT[name][symbol], rel=tolerance)
        assert 0 < fit.errors[name][symbol] < 2.5 * tolerance * JOINT[name][symbol]
    assert fit.at_bounds == ()


def test_a_fit_differentiates_once_in_a_while_and_ends_where_it_would_otherwise(monkeypatch):
    fitter = fitter_of(simulate_trial(JOINT, seed=3, duration=40.0))
    computed = []
    plain = Projection._differentiated
    monkeypatch.setattr(
        Projection, "_differentiated", lambda self, x: computed.append(x) or plain(self, x)
    )
    start = {"reflex": {"delay": 0.07, "omega": 12.0, "z": 1.2}}
    terms = tuple(JOINT)
    found, counts = [], []
    for updates in (0, projection.UPDATES):
        monkeypatch.setattr(projection, "UPDATES", updates)
        computed.clear()
        found.append(fitter.fit(terms, start, tolerance=1e-8))
        counts.append(len(computed))
    assert counts[1] < 0.6 * counts[0]
    assert found[1].score == pytest.approx(found[0].score, rel=1e-6)
    for symbol in ("delay", "omega", "z"):
        values = [fit.values["reflex"][symbol] for fit in found]
        assert values[1] == pytest.approx(values[0], rel=1e-3)


def test_a_corrected_jacobian_agrees_with_what_the_residual_did():
    fitter = fitter_of(simulate_trial(JOINT, seed=3, duration=40.0))
    values = fitter.start_values(tuple(JOINT), JOINT)
    free = fitter.searched(tuple(JOINT))
    problem = Projection(fitter, values, free, fitter.rows.used)
    first = np.array([to_unit(p, values[name][p.symbol]) for name, p in free])
    before = problem.residual(first)
    problem.jacobian(first)
    step = np.array([0.02, -0.01, 0.015])
    after = problem.residual(first + step)
    corrected = problem.jacobian(first + step)
    assert corrected @ step == pytest.approx(after - before, abs=1e-9 * np.abs(after).max())
    assert np.array_equal(problem.jacobian(first + step), corrected)


def test_least_squares_see_the_same_lengths_and_products():
    fitter = Fitter.of(motion_of(simulate_trial({}, seed=3, duration=20.0)))
    values = fitter.start_values(list(JOINT))
    problem = Projection(fitter, values, fitter.searched(list(JOINT)), fitter.rows.fitted)
    units = problem.first
    residual, jacobian = problem.residual(units), problem.jacobian(units)
    short, turned = problem.short_residual(units), problem.short_jacobian(units)
    assert short @ short == pytest.approx(residual @ residual)
    assert short @ turned == pytest.approx(residual @ jacobian)
    assert turned.T @ turned == pytest.approx(jacobian.T @ jacobian)


def test_no_derivatives_are_computed_where_a_fit_ends(monkeypatch):
    fitter = fitter_of(simulate_trial(JOINT, seed=3, duration=40.0))
    computed = []
    slope = Fitter.slope
    monkeypatch.setattr(Fitter, "slope", lambda *a, **k: computed.append(a) or slope(*a, **k))
    start = {"reflex": {"delay": 0.07, "omega": 12.0, "z": 1.2}}
    # They are due at the beginning and after each three updates: the last time where it ends.
    fitter.fit(tuple(JOINT), start, evaluations=projection.UPDATES + 2)
    assert len(computed) == len(fitter.searched(tuple(JOINT)))


def test_a_fit_leaves_the_joint_a_plausible_inertia():
    for joint in ("ankle", "wrist"):
        with JointProfile.load(joint).in_force():
            lowest, _ = joint_in_force().inertia_range
            low, high = ranges([("inertia", "I"), ("stiffness", "K")])
            assert low.tolist() == [lowest, 0.0]
            assert high[0] > lowest
    low, _ = joint_in_force().inertia_range
    assert not has_joint(SimpleNamespace(values={"inertia": {"I": low}}))
    assert has_joint(SimpleNamespace(values={"inertia": {"I": 2.0 * low}}))
    assert has_joint(SimpleNamespace(values={"stiffness": {"K": 80.0}}))


def test_other_parts_take_no_more_than_four_fifths_of_the_inertia():
    """In a half of a human trial a plate and a part beside it had taken 85 % of the inertia."""
    plate, part = {"footplate_inertia": {"Ip": 0.008}}, {"plate_appendage": {"Ia": 0.008}}
    heavy, light = ({"inertia": {"I": inertia}} for inertia in (0.012, 0.003))
    assert has_joint(SimpleNamespace(values={**heavy, **plate, **part}))
    assert has_joint(SimpleNamespace(values={**light, **plate}))
    assert not has_joint(SimpleNamespace(values={**light, **plate, **part}))
    with JointProfile.load("wrist").in_force():
        assert has_joint(SimpleNamespace(values={**light, **plate, **part}))


def test_standard_errors_agree_with_a_bootstrap_over_blocks():
    fitter = fitter_of(simulate_trial({}, seed=4, duration=40.0))
    fit = with_errors(fitter, fit_base(fitter))
    matrix, labels = fitter.derivatives(fit)
    used = np.flatnonzero(fitter.rows.used)
    blocks = np.array_split(used, 24)
    random = np.random.default_rng(0)
    drawn = []
    for _ in range(200):
        rows = np.concatenate([blocks[k] for k in random.integers(0, len(blocks), len(blocks))])
        drawn.append(np.linalg.lstsq(matrix[rows], fit.residual[rows], rcond=None)[0])
    spread = np.std(drawn, axis=0)
    for symbol in ("I", "B", "K", "G"):
        k = next(i for i, label in enumerate(labels) if label[1] == symbol)
        assert 0.5 < spread[k] / fit.errors[labels[k][0]][symbol] < 2.0


def test_what_two_parameters_share_is_known_where_neither_of_them_is():
    """Two terms for one effect: least squares and stretches know each to a different extent."""
    fitter = fitter_of(simulate_trial({}, seed=4, duration=40.0))
    fit = with_errors(fitter, fit_base(fitter))
    K, G = ("stiffness", "K"), ("reflex", "G")
    assert fit.error_of({K: 1.0}) == pytest.approx(fit.errors["stiffness"]["K"], rel=0.01)
    random = np.random.default_rng(1)
    for wide, narrow in ((30.0, 3.0), (3.0, 30.0)):
        unknown = random.standard_normal(len(fit.draws[K]))
        fit.draws[K], fit.draws[G] = wide * unknown, -wide * unknown
        fit.spreads[K], fit.spreads[G] = np.array([narrow, 0.5]), np.array([-narrow, 0.0])
        assert fit.error_of({K: 1.0}) == pytest.approx(30.0, rel=0.2)
        assert fit.error_of({K: 1.0, G: 1.0}) == pytest.approx(0.5)
    both = fit.error_of({K: np.array([1.0, 0.0, 2.0])})
    assert both == pytest.approx(fit.error_of({K: 1.0}) * np.array([1.0, 0.0, 2.0]))


def test_no_parameter_is_known_worse_than_its_range(monkeypatch):
    fitter = Fitter.of(motion_of(simulate_trial({}, seed=4, duration=20.0)))

    def anything(matrix, *_):
        return 1e6 * np.random.default_rng(0).standard_normal((50, matrix.shape[1]))

    monkeypatch.setattr(standard_errors, "bootstrap_changes", anything)
    fit = with_errors(fitter, fit_base(fitter))
    for name, symbol in (("stiffness", "K"), ("reflex", "delay")):
        parameter = term_library()[name].parameter(symbol)
        assert fit.errors[name][symbol] == parameter.upper - parameter.lower


def test_bounded_least_squares_keeps_physical_signs():
    random = np.random.default_rng(0)
    matrix = random.standard_normal((500, 2))
    target = matrix @ np.array([-0.4, 2.0])
    amplitudes = bounded(matrix, target, *ranges([("viscosity", "B"), ("stiffness", "K")]))
    assert amplitudes[0] == pytest.approx(0.0, abs=1e-12)
    assert amplitudes[1] == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("columns", [0, 2])
def test_where_every_amplitude_is_at_its_bound_nothing_is_spanned(columns):
    """A model may start so that no column is left free."""
    assert orthonormal(np.zeros((5, columns))).shape == (5, 0)


def test_a_part_that_a_joint_lacks_is_no_bound_that_stopped_the_fit():
    bonds = {"k1": 40.0, "k2": 0.0, "k3": 0.0, "k4": 5.0, "recovery": 0.3}
    name = "distributed_short_range_stiffness"
    assert absent_parts({name: bonds}) == (f"{name}.k2", f"{name}.k3")
    assert at_bounds({name: bonds}) == ()
    assert at_bounds({name: {**bonds, "k1": 2000.0}}) == (f"{name}.k1",)
    none = {**bonds, "k1": 0.0, "k4": 0.0}
    assert absent_parts({name: none}) == ()
    assert at_bounds({name: none}) == tuple(f"{name}.k{number}" for number in range(1, 5))


@pytest.mark.parametrize(
    ("changed", "simple"),
    [
        ({"recovery": 20.0}, ("short_range_stiffness.recovery",)),
        ({"recovery": 0.02}, ()),
        ({"yield": 0.05}, ()),
        ({}, ()),
    ],
)
def test_bonds_that_never_attach_anew_are_a_limit_case(changed, simple):
    """They say nothing against the term; a yield outside the movement does."""
    name = "short_range_stiffness"
    values = {name: {"k": 40.0, "yield": 0.007, "recovery": 0.5, **changed}}
    assert limit_cases(values) == simple
    assert at_bounds(values) == tuple(f"{name}.{symbol}" for symbol in changed)


def test_scaled_parameters_return():
    for term in term_library().values():
        for parameter in term.parameters:
            assert from_unit(parameter, to_unit(parameter, parameter.default)) == pytest.approx(
                parameter.default, abs=1e-9
            )


def test_autoregression_whitens():
    random = np.random.default_rng(0)
    noise = random.standard_normal(20000)
    coloured = np.zeros_like(noise)
    for k in range(2, len(noise)):
        coloured[k] = 1.5 * coloured[k - 1] - 0.7 * coloured[k - 2] + noise[k]
    coefficients = autoregression(coloured, 10)
    assert coefficients[:3] == pytest.approx([1.0, -1.5, 0.7], abs=0.04)


@pytest.mark.parametrize(
    "name", [n for n, t in term_library().items() if t.place is Place.TORQUE_SENSOR]
)
def test_frequency_response_of_a_sensor_is_its_simulation(name):
    rate = 4000.0
    time = np.arange(int(4 * rate)) / rate
    term = term_library()[name]()
    values = {p.symbol: p.default for p in term.parameters}
    for frequency in (3.0, 17.0, 40.0):
        wave = np.sin(2 * np.pi * frequency * time)
        signals = Signals(rate, wave, wave, wave)
        signals.torque = wave
        term.transform(signals, values, term.start(rate))
        (response,) = term.response(np.array([frequency]), values)
        late = time > 2.0
        expected = np.imag(response * np.exp(2j * np.pi * frequency * time))
        assert np.abs(signals.torque - expected)[late].max() < 0.01 * np.abs(response)


def test_a_model_that_runs_away_is_avoided_and_never_chosen(monkeypatch):
    fitter = Fitter.of(motion_of(simulate_trial({}, seed=4, duration=20.0)))
    best = fit_base(fitter)
    delay = best.values["reflex"]["delay"]
    spectra = fitter.columns.spectra

    def running_away(values, foot=None):
        found = spectra(values, foot)
        beyond = values["reflex"]["delay"] > delay + 1e-5
        return {c: s * 1e200 for c, s in found.items()} if beyond else found

    monkeypatch.setattr(fitter.columns, "spectra", running_away)
    early = {**best.values, "reflex": {**best.values["reflex"], "delay": delay - 0.004}}
    found = fitter.fit(best.terms, early)
    assert np.isfinite(found.score)
    assert found.score < fitter.solve(early).score
    assert found.values["reflex"]["delay"] <= delay + 1e-5
    late = {**best.values, "reflex": {**best.values["reflex"], "delay": delay + 0.004}}
    assert fitter.fit(best.terms, late).score == np.inf


@pytest.mark.parametrize("beyond", [1e200, np.nan])
def test_torque_of_no_column_that_runs_away_is_no_fit(monkeypatch, beyond):
    fitter = Fitter.of(motion_of(simulate_trial({}, seed=4, duration=20.0)))
    best = fit_base(fitter)
    nothing = np.zeros_like(fitter.columns.target)
    monkeypatch.setattr(fitter.columns, "offset", lambda *_: nothing)
    assert fitter.solve(best.values).score == pytest.approx(best.score)
    monkeypatch.setattr(fitter.columns, "offset", lambda *_: nothing + beyond)
    assert fitter.solve(best.values).score == np.inf


@pytest.mark.parametrize("name", ["tendon", "maxwell_relaxation"])
@pytest.mark.parametrize("beyond", [1e200, np.nan])
def test_a_candidate_that_runs_away_promises_nothing(monkeypatch, name, beyond):
    fitter = Fitter.of(motion_of(simulate_trial({}, seed=4, duration=20.0)))
    best = fit_base(fitter)
    spectra = fitter.columns.spectra

    def running_away(values, foot=None):
        return {c: s * beyond if name in values else s for c, s in spectra(values, foot).items()}

    monkeypatch.setattr(fitter.columns, "spectra", running_away)
    (screened,) = screen(fitter, best, {name: grid(name, 20.0)})
    assert screened.share <= 0.0
