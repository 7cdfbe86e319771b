"""Shapes of one edge: derivatives, ends and bounds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ankle_interfaces.errors import QuantityError
from perturbation_generator.edge_train import EdgeTrain
from perturbation_generator.edges import SHAPE_PARAMETERS, Block, Filtered, Polynomial, shape_from

SMOOTH = st.one_of(
    st.builds(Filtered, st.floats(2.0, 200.0), st.floats(0.3, 0.99)),
    st.builds(Polynomial, st.floats(0.005, 0.2)),
)


def unit(shape, age, rate=2048.0):
    return np.array(shape.unit(age, np.arange(len(age)), rate))


@given(shape=SMOOTH)
@settings(max_examples=50, deadline=None)
def test_velocity_and_acceleration_are_the_derivatives(shape):
    h = shape.settling * 1e-6
    age = np.linspace(2 * h, shape.settling, 3000)[:-1]
    before, here, after = unit(shape, age - h), unit(shape, age), unit(shape, age + h)
    numeric = (after - before) / (2 * h)
    for order in (0, 1):
        assert np.abs(numeric[order] - here[order + 1]).max() < 1e-6 * np.abs(here[order + 1]).max()


@pytest.mark.parametrize("shape", [Filtered(), Filtered(60.0, 0.3), Polynomial(), Block()])
def test_an_edge_goes_from_zero_to_one(shape):
    start = unit(shape, np.zeros(3))[:, 0]
    end = unit(shape, np.full(3, shape.settling + 0.01))[:, -1]
    assert start[0] == (1.0 if shape.name == "block" else 0.0)
    np.testing.assert_allclose(
        end, [1.0, 0.0, 0.0], atol=[2e-16, 1e-12, 1e-9][0] if shape.name != "filtered" else 1e-9
    )


def test_a_block_moves_by_its_step_in_one_sample():
    train = EdgeTrain(Block(), 1000.0)
    train.add(0.01, 0.04)
    train.add(0.05, 0.0)
    x, v, a = train.samples(0, 100).T
    assert np.flatnonzero(x).tolist() == list(range(10, 50))
    np.testing.assert_allclose(v, np.diff(x, prepend=0.0) * 1000.0)
    np.testing.assert_allclose(a, np.diff(v, prepend=0.0) * 1000.0)


def test_filtered_is_the_block_behind_a_second_order_low_pass():
    from scipy.signal import StateSpace, lsim

    rate, shape = 20_000.0, Filtered(30.0, 0.7)
    omega = 2 * np.pi * 30.0
    block, filtered = EdgeTrain(Block(), rate), EdgeTrain(shape, rate)
    for train in (block, filtered):
        train.add(0.01, 0.04)
        train.add(0.05, 0.0)
        train.add(0.06, 0.03)
    plant = StateSpace(
        [[0, 1], [-(omega**2), -1.4 * omega]], [[0], [omega**2]], np.eye(2), np.zeros((2, 1))
    )
    u = block.samples(0, 4000)[:, 0]
    _, expected, _ = lsim(plant, u, np.arange(4000) / rate, interp=False)
    got = filtered.samples(0, 4000)
    assert np.abs(got[:, 0] - expected[:, 0]).max() < 1e-12
    assert np.abs(got[:, 1] - expected[:, 1]).max() < 1e-9


@given(
    shape=SMOOTH,
    rate=st.floats(500.0, 10_000.0),
    gaps=st.lists(st.floats(1.0, 3.0), min_size=1, max_size=12),
    up=st.randoms(),
)
@settings(max_examples=60, deadline=None)
def test_no_train_of_edges_passes_the_bounds(shape, rate, gaps, up):
    spacing = shape.length or 0.02
    train = EdgeTrain(shape, rate)
    time = 0.0
    for gap in gaps:
        train.add(time, up.choice([0.0, 0.5, 1.0]))
        time += gap * spacing
    samples = train.samples(0, int((time + shape.settling) * rate) + 10)
    bound = shape.extremes(1.0, spacing, rate)
    reached = np.abs(samples).max(axis=0)
    assert reached[0] <= (1 + bound.position) * (1 + 1e-9)
    assert reached[1] <= bound.velocity * (1 + 1e-9)
    assert reached[2] <= bound.acceleration * (1 + 1e-9)


def test_a_single_edge_reaches_the_bounds():
    for shape in (Polynomial(), Filtered(30.0)):
        samples = unit(shape, np.linspace(0, shape.settling, 1_000_001))
        bound = shape.extremes(1.0, 10.0, 2048.0)
        assert np.abs(samples[1]).max() == pytest.approx(bound.velocity, rel=1e-9)
        assert np.abs(samples[2]).max() == pytest.approx(bound.acceleration, rel=1e-9)
        assert samples[0].max() == pytest.approx(1 + bound.position, rel=1e-9)


def test_shape_from_parameter_values():
    values = {parameter.name: parameter.default for parameter in SHAPE_PARAMETERS}
    assert shape_from(values) == Polynomial(0.024)
    assert shape_from(values | {"shape": "filtered", "bandwidth": 60.0}) == Filtered(60.0, 0.7)
    assert shape_from(values | {"shape": "block"}) == Block()


def test_values_without_sense_are_refused():
    with pytest.raises(QuantityError, match=r"'damping' = 1\.5 is refused; allowed: 0\.3 to 0\.99"):
        Filtered(30.0, 1.5)
    with pytest.raises(ValueError, match="longer than 0 s, got 0 s"):
        Polynomial(0.0)
