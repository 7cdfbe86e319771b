"""The fit's spectra make the torque that the simulation makes, for every term."""

from dataclasses import replace

import numpy as np
import pytest

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.model import Model
from ankle_physics.term import Place, term_library
from model_discrepancy.fit.columns import Columns
from model_discrepancy.fit.coupled_foot import Mover, Plate, Push, torque_of
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.rows import Rows
from model_discrepancy.recording.motion import Motion, motion_of
from model_discrepancy.tools.resimulation import simulated_torque
from simulation_study.planted_trials import STRENGTHS, simulate_trial

BASE = {
    "inertia": {"I": 0.012},
    "viscosity": {"B": 0.8},
    "stiffness": {"K": 90.0},
    "reflex": {"G": 8.0, "delay": 0.041, "omega": 21.0, "z": 0.8},
}
# What moves the position reading changes no torque.
TERMS = [
    n
    for n, term in term_library().items()
    if term.searched and term.place is not Place.POSITION_SENSOR
]


@pytest.fixture(scope="module")
def motion() -> Motion:
    moved = motion_of(simulate_trial({}, seed=3, duration=30.0, rate=1024.0))
    return replace(moved, cocontraction=np.sqrt(2.0) * np.sin(moved.time))


def _torques(motion: Motion, extra: dict[str, dict[str, float]]) -> tuple[np.ndarray, np.ndarray]:
    """Used rows of the simulated torque, and of what the fit's spectra say."""
    rows = Rows(len(motion.position), motion.rate)
    fitter = Fitter(Columns(motion, rows))
    values = {
        name: {**fitter.start_values([name])[name], **given}
        for name, given in {**BASE, **extra}.items()
    }
    made = rows.plain(rows.spectrum(simulated_torque(Model.of(values), motion)))
    return made[rows.used], (fitter.plain_target - fitter.evaluate(values).plain)[rows.used]


@pytest.mark.parametrize(("samples", "rate"), [(6144, 512.0), (5001, 300.0), (4001, 150.0)])
def test_the_spectrum_of_a_column_is_its_fourier_transform_without_the_mean(samples, rate):
    rows = Rows(samples, rate)
    column = np.random.default_rng(2).standard_normal(samples) + 3.0
    at = np.linspace(0, len(rows.frequency) - 1, 40).astype(int)
    turns = np.outer(rows.frequency[at], np.arange(samples)) / rate
    expected = np.exp(-2j * np.pi * turns) @ (column - column.mean())
    np.testing.assert_allclose(rows.spectrum(column)[at], expected, atol=1e-8)


@pytest.mark.parametrize("name", TERMS)
def test_both_make_the_same_torque(motion: Motion, name: str) -> None:
    without, _ = _torques(motion, {})
    extra = {name: STRENGTHS.get(name, {})}
    coupled = issubclass(term_library()[name], CompliantCoupling)
    if coupled:
        extra = {name: {"k_s": 1200.0, "b_s": 1.0}, "footplate_inertia": {"Ip": 0.003}}
    made, said = _torques(motion, extra)
    effect = float(np.std(made - without))
    assert effect > 0.0
    # A skew, lag or strap is filtered exactly there and sample by sample here.
    assert np.std(made - said) < 0.05 * effect + 0.002 * np.std(made)


BEHIND_STRAPS = {
    "fixation_compliance": {"k_s": 1000.0, "b_s": 1.0},
    "footplate_inertia": {"Ip": 0.005},
}


@pytest.mark.parametrize(
    "others",
    [
        {"saturating_damping": {"D": 1.5, "vs": 0.3}},
        {"maxwell_relaxation": {"k": 70.0, "T": 0.04}},
        {"short_range_stiffness": {"k": 200.0, "yield": 0.002, "recovery": 0.04}},
        {"dahl_hysteresis": {"F": 0.8, "slide": 0.02}, "reflex": {**BASE["reflex"], "G": 30.0}},
        {"backlash": {"gap": 0.003}},
        {"lost_motion": {"gap": 0.003}},
    ],
    ids=lambda others: next(iter(others)),
)
def test_what_acts_on_a_foot_behind_straps_moves_it(
    motion: Motion, others: dict[str, dict[str, float]]
) -> None:
    stiff, _ = _torques(motion, others)
    made, said = _torques(motion, {**BEHIND_STRAPS, **others})
    assert np.std(made - stiff) > 0.1 * np.std(made)
    assert np.std(made - said) < 0.02 * np.std(made)


def test_a_foot_behind_straps_that_stiffen_is_moved_by_its_reflex_too(motion: Motion) -> None:
    straps = {"stiffening_fixation": {"k_s": 1000.0, "b_s": 1.0, "curvature": 60.0}}
    reflex = {"reflex": {**BASE["reflex"], "G": 30.0}}
    made, said = _torques(motion, {**straps, **reflex})
    # The fit takes the stiffness at the mean load, the simulation at rest.
    assert np.std(made - said) < 0.03 * np.std(made)


def test_a_fit_takes_its_steps_beside_a_foot_that_is_held(motion: Motion) -> None:
    columns = Columns(motion, Rows(len(motion.position), motion.rate))
    values = Fitter(columns).start_values(
        [*BASE, *BEHIND_STRAPS, "saturating_damping"],
        {**BASE, **BEHIND_STRAPS, "saturating_damping": {"D": 0.5, "vs": 0.5}},
    )
    foot = columns.foot(values)
    amplitudes = {c: values[c[0]][c[1]] for c in columns.spectra(values, foot)}
    for name, symbol in (("fixation_compliance", "k_s"), ("inertia", "I"), ("reflex", "delay")):
        moved = {n: dict(v) for n, v in values.items()}
        moved[name][symbol] *= 1.02
        held = columns.change(values, moved, amplitudes, foot)
        if name == "inertia":
            held = held + 0.02 * values[name][symbol] * columns.spectra(values, foot)[name, symbol]
        exact = columns.torque(moved) - columns.torque(values)
        assert np.linalg.norm(held - exact) < 0.25 * np.linalg.norm(exact), name


@pytest.mark.parametrize("name", TERMS)
def test_a_change_of_values_changes_the_torque_by_the_sum_of_its_columns(
    motion: Motion, name: str
) -> None:
    columns = Columns(motion, Rows(len(motion.position), motion.rate))
    fitter = Fitter(columns)
    coupled = term_library()[name].place is Place.COUPLING
    # Straps move the foot and a lag filters the reading: each column depends on both.
    others = ("torque_sensor_lag",) if coupled else ("torque_sensor_lag", "fixation_compliance")
    values = {
        n: {**fitter.start_values([n])[n], **STRENGTHS.get(n, {}), **BASE.get(n, {})}
        for n in dict.fromkeys([*BASE, *others, name])
    }
    foot = columns.foot(values)
    before, offset = columns.spectra(values, foot), columns.offset(values, foot)
    amplitudes = {(n, symbol): values[n][symbol] for n, symbol in before}
    searched = fitter.searched(list(values))
    assert searched
    for owner, parameter in searched:
        moved = {**values, owner: {**values[owner]}}
        value = values[owner][parameter.symbol]
        moved[owner][parameter.symbol] = 1.01 * value if value != 0.0 else 0.01 * parameter.upper
        after = columns.spectra(moved, foot)
        expected = sum(amplitudes[c] * (after[c] - before[c]) for c in before)
        if offset is not None:
            expected = expected + columns.offset(moved, foot) - offset
        change = columns.change(values, moved, amplitudes)
        assert change is not None, (owner, parameter.symbol)
        size = max(float(np.abs(amplitudes[c] * before[c]).max()) for c in before)
        assert np.abs(change - expected).max() < 1e-10 * size, (owner, parameter.symbol)


def test_equal_values_change_nothing(motion: Motion) -> None:
    columns = Columns(motion, Rows(len(motion.position), motion.rate))
    values = Fitter(columns).start_values(list(BASE), BASE)
    amplitudes = {(n, symbol): values[n][symbol] for n, symbol in columns.spectra(values)}
    assert columns.change(values, {n: dict(v) for n, v in values.items()}, amplitudes) is None


def test_the_torque_of_an_impedance_on_a_moved_foot_is_that_of_its_motion(motion: Motion) -> None:
    plate = Plate(motion.rate, motion.position, motion.velocity, motion.acceleration)
    term = term_library()["fixation_compliance"]()
    assert isinstance(term, CompliantCoupling)
    mover = Mover(plate, term, {"k_s": 1200.0, "b_s": 1.0}, (0.012, 0.8, 90.0))
    push, like, of = Push(0.3 * motion.torque), (0.001, 0.1, 8.0), (0.013, 0.9, 98.0)
    expected = torque_of(of, *mover.moved(push, like))
    assert mover.torque(push, like, of) == pytest.approx(expected, abs=1e-9)
