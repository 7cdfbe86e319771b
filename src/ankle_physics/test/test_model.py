"""Terms, model files and the reflex equation against an independent integration."""

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ankle_physics.errors import ModelError
from ankle_physics.linear_dynamics import Delay, FirstOrder, SecondOrder
from ankle_physics.model import Model, StatedAt, StatedValue
from ankle_physics.signals import Signals
from ankle_physics.term import term_library

RATE = 2048.0
TIME = np.arange(int(2 * RATE)) / RATE


def sine(frequency=3.0, amplitude=0.04):
    w = 2 * np.pi * frequency
    return (
        amplitude * np.cos(w * TIME),
        -amplitude * w * np.sin(w * TIME),
        -amplitude * w**2 * np.cos(w * TIME),
    )


def test_paper_model_against_an_independent_integration():
    x, v, a = sine()
    rate_of_stretch = lambda t: (  # noqa: E731
        max(-0.04 * 6 * np.pi * np.sin(6 * np.pi * (t - 0.04)), 0.0) if t >= 0.04 else 0.0
    )
    muscle = solve_ivp(
        lambda t, y: [y[1], 21.0**2 * (rate_of_stretch(t) - y[0]) - 2 * 0.8 * 21.0 * y[1]],
        [0, TIME[-1]],
        [0, 0],
        t_eval=TIME,
        max_step=1e-3,
        rtol=1e-9,
        atol=1e-12,
    )
    expected = 0.0137 * a + 0.63 * v + 100.0 * x + 10.0 * muscle.y[0]
    assert (
        np.abs(Model.of().torque(Signals(RATE, x, v, a)) - expected).max()
        < 1e-4 * np.abs(expected).max()
    )


@pytest.mark.parametrize("name", sorted(term_library()))
def test_every_term_gives_the_same_in_blocks_as_in_one_go(name):
    x, v, a = sine(7.0)
    model = Model.of({"inertia": {}, "viscosity": {}, "stiffness": {}, "reflex": {}, name: {}})
    whole = model.torque(Signals(RATE, x, v, a))
    run = model.start(RATE)
    cuts = np.cumsum([0, 1, 31, 64, 3, 500, 32, len(x)])
    parts = [
        run.torque(Signals(RATE, x[i:j], v[i:j], a[i:j]))
        for i, j in itertools.pairwise(cuts)
        if i < len(x)
    ]
    assert np.abs(np.concatenate(parts) - whole).max() < 1e-9


@pytest.mark.parametrize("name", sorted(term_library()))
def test_every_term_states_its_parameters(name):
    term = term_library()[name]
    assert term.sentence.endswith(".")
    assert term.__doc__
    for parameter in term.parameters:
        assert parameter.lower <= parameter.default <= parameter.upper
        assert parameter.source


@pytest.mark.parametrize("name", sorted(term_library()))
def test_every_term_gives_each_of_its_parameters_a_sentence(name):
    parameters = term_library()[name].parameters
    for parameter in parameters:
        assert parameter.description.startswith(("It is ", "It says ", "It multiplies ")), (
            parameter.symbol
        )
        assert parameter.description.endswith("."), parameter.symbol
    assert len({parameter.description for parameter in parameters}) == len(parameters)


def test_a_model_file_survives_saving(tmp_path):
    model = Model.of(
        {"inertia": {}, "stiffness": {"K": 55.5}, "reflex": {"delay": 0.045}},
        title="subject 3, block 2",
    )
    model.entry("stiffness").standard_errors["K"] = 0.25
    model.stated = {"K": StatedValue(55.5, 3.0), "G": StatedValue(9.0, 0.5)}
    model.stated_at = StatedAt(0.02, -3.0, 45.0)
    model.save(tmp_path / "model.yaml")
    again = Model.load(tmp_path / "model.yaml")
    assert again.stated == model.stated
    assert again.stated_at == model.stated_at
    assert [entry.values for entry in again.entries] == [entry.values for entry in model.entries]
    assert again.title == model.title
    assert again.entry("stiffness").standard_errors == {"K": 0.25}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("terms: [{term: spring}]", "unknown term 'spring'"),
        ("terms: [{term: stiffness, 'K[N.m/deg]': 3}]", "unknown parameter 'K\\[N.m/deg\\]'"),
        (
            "terms: [{term: stiffness, 'K[N.m/rad]': -3}]",
            "'stiffness.K' = -3.0 N.m/rad is refused; allowed: 0 to 1000 N.m/rad",
        ),
        ("terms: [{term: stiffness, 'K[N.m/rad]': soft}]", "'stiffness.K' = 'soft' is refused"),
        ("terms: [{term: inertia}, {term: inertia}]", "appears 2 times"),
        ("{terms: [], impedance_at: {'position[rad]': 0.1}}", "'impedance_at' has finite"),
        (
            "{terms: [], impedance_at: {'position[rad]': .nan, 'torque[N.m]': 0, 'time[s]': 1}}",
            "'impedance_at' has finite",
        ),
        (
            "{terms: [{term: stiffness, 'K[N.m/rad]': {value: 9, standard_error: '1,5'}}]}",
            "the standard_error of 'K.N.m/rad.' = '1,5' is refused",
        ),
        ("{terms: [], impedance: {'B[N.m]': 3}}", "unknown value 'B\\[N.m\\]'"),
        ("{terms: [], impedance: {'K[N.m/rad]': 3}}", "has 'value' and 'standard_error'"),
        (
            "{terms: [], impedance: {'K[N.m/rad]': {value: 3, standard_error: -1}}}",
            "standard error -1 is refused",
        ),
        ("{terms: [], impedance: 3}", "'impedance' names"),
        ("hello", "list 'terms'"),
        ("terms: [", "not YAML"),
    ],
)
def test_bad_model_files_are_named(tmp_path, text, words):
    (tmp_path / "m.yaml").write_text(text)
    with pytest.raises(ModelError, match=words):
        Model.load(tmp_path / "m.yaml")


def test_a_gain_may_change_from_sample_to_sample():
    x, v, a = sine()
    model = Model.of({"stiffness": {}})
    model.entry("stiffness").values["K"] = np.linspace(50.0, 150.0, len(x))
    assert np.allclose(model.torque(Signals(RATE, x, v, a)), np.linspace(50.0, 150.0, len(x)) * x)


def test_delay_is_exact_for_a_ramp_at_any_fraction():
    delayed = Delay(RATE, 0.08).run(TIME, 0.04037)
    late = TIME > 0.05
    assert np.abs(delayed[late] - (TIME[late] - 0.04037)).max() < 1e-12


@pytest.mark.parametrize("damping", [0.4, 1.0, 1.7])
def test_second_order_follows_its_equation(damping):
    # A ramp is answered by a ramp that lags by 2 z / w.
    y, rate, acceleration = SecondOrder(RATE).run_with_rates(TIME, 30.0, damping)
    late = TIME > 1.5
    assert np.abs(y - (TIME - 2 * damping / 30.0))[late].max() < 1e-6
    assert np.abs(rate - 1.0)[late].max() < 1e-6
    assert np.abs(acceleration)[late].max() < 1e-4


def test_first_order_lags_a_ramp_by_its_time_constant():
    y = FirstOrder(RATE).run(TIME, 0.1)
    assert abs(y[-1] - (TIME[-1] - 0.1)) < 1e-6
