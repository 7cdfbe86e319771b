"""Properties of every signal: derivatives, blocks, rate, seed, bounds, end, onsets, amplitude."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ankle_interfaces.errors import QuantityError
from perturbation_generator.edges import Block, Filtered, Polynomial
from perturbation_generator.parameters import PARAMETERS
from perturbation_generator.settings import SIDES, Settings
from perturbation_generator.signals import SIGNALS, signal_from

# A signal that waits for requests does not move by itself; it has tests of its own.
BY_THEMSELVES = sorted(set(SIGNALS) - {"on_request"})
NAMES = st.sampled_from(BY_THEMSELVES)
# The signal that calibrates a rig begins with a rest that is longer than these tests look.
MOVING_AT_ONCE = sorted(set(BY_THEMSELVES) - {"rig_calibration"})
MOVING_NAMES = st.sampled_from(MOVING_AT_ONCE)
SHAPES = st.sampled_from([Polynomial(), Filtered(), Filtered(8.0, 0.4), Block()])
DIRECTIONS = st.sampled_from(sorted(SIDES))
EVERY = pytest.mark.parametrize("name", BY_THEMSELVES)


@given(
    NAMES,
    SHAPES,
    DIRECTIONS,
    st.integers(0, 99),
    st.lists(st.integers(0, 700), min_size=1, max_size=12),
    st.floats(500, 4000),
)
@settings(max_examples=40, deadline=None)
def test_samples_do_not_depend_on_the_block_size(name, shape, direction, seed, sizes, rate):
    common = Settings(rate=rate, shape=shape, direction=direction, seed=seed, ramp_in=1.0)
    one, other = SIGNALS[name](common), SIGNALS[name](common)
    whole = one.next(sum(sizes))
    pieces = np.concatenate([other.next(n) for n in sizes])
    assert whole.shape == (sum(sizes), 3)
    np.testing.assert_array_equal(whole, pieces)
    assert one.onsets() == other.onsets()


@pytest.mark.parametrize("name", MOVING_AT_ONCE)
@pytest.mark.parametrize("shape", [Polynomial(), Filtered()])
def test_velocity_and_acceleration_are_the_derivatives_of_position(name, shape):
    rate = 10_000.0
    x, v, a = SIGNALS[name](Settings(rate=rate, shape=shape, ramp_in=0.5)).next(40_000).T
    # Central differences; the acceleration of a filtered block jumps at each edge, where no
    # difference can follow.
    calm = np.abs(np.diff(a, prepend=a[0]))[1:-1] < 100.0
    calm &= np.roll(calm, -1)
    assert calm.mean() > 0.98
    assert np.abs((x[2:] - x[:-2]) * rate / 2 - v[1:-1])[calm].max() < 1e-3 * np.abs(v).max()
    # The polynomial's third derivative jumps by 60 / T³ at its ends, by twice that where a fall
    # follows a rise at once: a central difference is wrong by a quarter of the jump per sample.
    jump = 0.04 * 2 * 60 / 0.024**3 / rate / 4 if isinstance(shape, Polynomial) else 0.0
    assert np.abs((v[2:] - v[:-2]) * rate / 2 - a[1:-1])[calm].max() < 2e-3 * np.abs(a).max() + jump


@EVERY
@pytest.mark.parametrize("shape", [Polynomial(), Filtered()])
def test_the_signal_is_the_same_at_every_rate(name, shape):
    slow = SIGNALS[name](Settings(rate=1000.0, shape=shape, seed=5)).next(30_000)
    fast = SIGNALS[name](Settings(rate=4000.0, shape=shape, seed=5)).next(120_000)[::4]
    np.testing.assert_allclose(fast[:, :2], slow[:, :2], rtol=0, atol=1e-9)


@EVERY
def test_the_seed_makes_the_signal(name):
    def samples(seed):
        return SIGNALS[name](Settings(seed=seed)).next(30_000)

    np.testing.assert_array_equal(samples(7), samples(7))
    assert np.abs(samples(7) - samples(8)).max() > 0.01


@given(MOVING_NAMES, SHAPES, DIRECTIONS, st.integers(0, 99), st.floats(0.001, 0.1))
@settings(max_examples=40, deadline=None)
def test_no_signal_passes_its_own_extremes_or_leaves_its_side(
    name, shape, direction, seed, amplitude
):
    signal = SIGNALS[name](
        Settings(rate=1000.0, shape=shape, direction=direction, seed=seed, amplitude=amplitude)
    )
    samples = signal.next(30_000)
    bound = signal.extremes(amplitude)
    reached = np.abs(samples).max(axis=0)
    assert np.all(
        reached <= np.array([bound.position, bound.velocity, bound.acceleration]) * (1 + 1e-9)
    )
    beyond = bound.position - amplitude + 1e-12
    if direction == "dorsiflexing":
        assert samples[:, 0].min() >= -beyond
    elif direction == "plantarflexing":
        assert samples[:, 0].max() <= beyond
    else:
        assert samples[:, 0].min() < 0 < samples[:, 0].max()


@given(MOVING_NAMES, SHAPES, DIRECTIONS, st.integers(0, 99), st.floats(6.0, 20.0))
@settings(max_examples=25, deadline=None)
def test_a_signal_with_a_duration_ends_at_rest(name, shape, direction, seed, duration):
    rate = 1000.0
    signal = SIGNALS[name](
        Settings(rate=rate, shape=shape, direction=direction, seed=seed, duration=duration)
    )
    samples = signal.next(signal.settings.samples + 500)
    last = math.ceil(duration * rate)
    assert np.all(np.abs(samples[last:]).max(axis=0) <= [1e-12, 1e-9, 1e-6])
    assert np.abs(samples[: last // 2]).max() > 0
    bound = signal.extremes(signal.amplitude)
    assert np.abs(np.diff(samples[:, 0])).max() * rate <= bound.velocity * (1 + 1e-9)


@pytest.mark.parametrize("name", ["pulse_step", "random_steps", "prbs"])
@pytest.mark.parametrize("direction", sorted(SIDES))
def test_onsets_are_where_the_position_leaves_a_level(name, direction):
    rate = 4000.0
    signal = SIGNALS[name](Settings(rate=rate, direction=direction, seed=3))
    signal.next(50)
    assert [onset.time for onset in signal.onsets()] in ([], [0.0])
    samples = np.concatenate([np.zeros((50, 3)), signal.next(60_000)])
    moving = samples[:, 1] != 0
    onsets = [onset for onset in signal.onsets() if 0.2 < onset.time < 14.9]
    assert len(onsets) > 20
    for onset in onsets:
        first = int(np.ceil(onset.time * rate - 1e-6))
        settled = first + round(0.024 * rate)
        level = samples[first - 1 if not moving[first - 1] else first, 0]
        assert samples[settled, 0] - level == pytest.approx(
            onset.direction * onset.amplitude, abs=1e-6
        )
        assert np.sign(samples[first + 2, 1]) == onset.direction
    travelled = np.abs(samples[round(0.2 * rate) : round(14.9 * rate), 1]).sum() / rate
    assert travelled == pytest.approx(sum(onset.amplitude for onset in onsets), rel=0.05)


@pytest.mark.parametrize("name", ["pulse_step", "random_steps", "prbs"])
@given(st.integers(1, 5000), st.floats(0.0, 0.08))
@settings(max_examples=15, deadline=None)
def test_a_new_amplitude_holds_from_the_next_movement_from_rest(name, when, amplitude):
    common = Settings(rate=1000.0, seed=2)
    changed, same = SIGNALS[name](common), SIGNALS[name](common)
    before = changed.next(when)
    changed.set_amplitude(amplitude)
    samples = np.concatenate([before, changed.next(6000)])[:, 0]
    reference = same.next(when + 6000)[:, 0]
    # What had begun goes on unchanged until the next movement from rest.
    level, rest = 0.0, when
    for onset in same.onsets():
        first = math.ceil(onset.time * 1000.0 - 1e-6)
        if level == 0.0 and first >= when:
            rest = first
            break
        level = round(level + onset.direction * onset.amplitude, 12)
    np.testing.assert_array_equal(samples[:rest], reference[:rest])
    np.testing.assert_allclose(
        samples[rest:], reference[rest:] * amplitude / 0.04, rtol=0, atol=1e-12
    )


def test_a_new_amplitude_of_a_multisine_fades_within_its_extremes():
    signal, reference = (
        SIGNALS["multisine"](Settings(rate=1000.0, amplitude=0.02, duration=20.0)) for _ in range(2)
    )
    before = signal.next(3000)
    signal.set_amplitude(0.04)
    samples = np.concatenate([before, signal.next(17_000)])
    plain = reference.next(20_000)[:, 0]
    np.testing.assert_allclose(samples[4000:19_000, 0], 2 * plain[4000:19_000], rtol=0, atol=1e-12)
    bound = signal.extremes(0.04)
    assert np.all(
        np.abs(samples).max(axis=0) <= [bound.position, bound.velocity, bound.acceleration]
    )
    assert np.abs(samples[-1, 0]) < 1e-6
    late = SIGNALS["multisine"](Settings(rate=1000.0, amplitude=0.02, duration=20.0))
    late.next(18_500)
    late.set_amplitude(0.04)
    np.testing.assert_allclose(late.next(1500)[:, 0], plain[18_500:], rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", MOVING_AT_ONCE)
def test_ramp_in_grows_to_the_amplitude(name):
    samples = np.abs(SIGNALS[name](Settings(rate=1000.0, ramp_in=8.0)).next(30_000)[:, 0])
    first, second, later = samples[:1500].max(), samples[4000:6000].max(), samples[10_000:].max()
    assert 0 < first < 0.4 * later
    assert first < second < later
    assert later == pytest.approx(0.04, rel=0.1)


def test_signal_from_parameter_values():
    values = {parameter.name: parameter.default for parameter in PARAMETERS}
    signal = signal_from(
        values
        | {
            "signal": "prbs",
            "prbs.order": 5,
            "rate": 1000.0,
            "shape": "filtered",
            "bandwidth": 60.0,
        }
    )
    assert signal.name == "prbs"
    assert signal.own["order"] == 5
    assert signal.settings.rate == 1000.0
    assert signal.settings.shape == Filtered(60.0)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Settings(rate=100.0), "'rate' = 100.0 Hz is refused; allowed: 500 to 10000 Hz"),
        (
            lambda: Settings(direction="up"),
            "'direction' = 'up' is refused; allowed: one of dorsiflexing, plantarflexing, both",
        ),
        (
            lambda: SIGNALS["pulse_step"](Settings(), width=0.1),
            "has no parameter 'width'; it has block_length",
        ),
        (
            lambda: SIGNALS["pulse_step"](Settings(), stretch=3.0),
            "'pulse_step.stretch' = 3.0 s is refused; allowed: 0 to 2 s",
        ),
        (
            lambda: SIGNALS["pulse_step"](Settings(), pulse_width=0.3),
            "pulse_width' = 0.3 s is refused; it must be shorter than half",
        ),
        (
            lambda: SIGNALS["pulse_step"](Settings(shape=Polynomial(0.06)), pulse_width=0.04),
            "edges of 60 ms do not fit",
        ),
        (
            lambda: SIGNALS["random_steps"](Settings(), shortest_hold=0.5),
            "it must not be below 'random_steps.shortest_hold' = 0.5 s",
        ),
        (
            lambda: SIGNALS["prbs"](Settings(), clock=0.01),
            "edges of 24 ms do not fit: signal 'prbs' starts edges 10 ms apart",
        ),
        (lambda: SIGNALS["prbs"](Settings(duration=0.5)), "'duration' = 0.5 s is refused"),
        (lambda: SIGNALS["multisine"](Settings(duration=1.5)), "'duration' = 1.5 s is refused"),
        (
            lambda: SIGNALS["multisine"](Settings(), lowest=0.12, highest=0.18),
            "no frequency of the grid of 0.1 Hz",
        ),
    ],
)
def test_bad_values_are_refused_with_their_name_and_range(make, words):
    with pytest.raises(QuantityError) as refusal:
        make()
    assert words in str(refusal.value)


def test_every_parameter_has_unit_range_and_description():
    assert len({parameter.name for parameter in PARAMETERS}) == len(PARAMETERS)
    for parameter in PARAMETERS:
        assert parameter.description.endswith(".")
        assert parameter.check(parameter.default) == parameter.default
        if isinstance(parameter.default, (int, float)) and not isinstance(parameter.default, bool):
            assert parameter.unit
            assert math.isfinite(parameter.lower)
            assert math.isfinite(parameter.upper)
    assert [parameter.name for parameter in PARAMETERS if not parameter.start_only] == ["amplitude"]


@pytest.mark.parametrize("name", ["pulse_step", "random_steps", "prbs", "rig_calibration"])
def test_movements_that_began_can_be_forgotten_and_later_ones_are_kept(name):
    settings = Settings(rate=1000.0, seed=3)
    whole, forgetful = SIGNALS[name](settings), SIGNALS[name](settings)
    whole.next(60_000)
    kept = []
    for _ in range(60):
        forgetful.next(1000)
        kept += forgetful.onsets()
        forgetful.forget_onsets()
        assert forgetful.onsets() == []
    assert kept == whole.onsets()
    assert len(kept) > 20
