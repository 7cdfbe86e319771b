"""Figure 2 of van 't Veld et al. 2018: signals that keep the reflex out of the estimate."""

import numpy as np
import pytest

from perturbation_generator import figure2
from perturbation_generator.correlation import cross_correlation, residual
from perturbation_generator.edges import Block, Polynomial
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings


@pytest.fixture(scope="module", params=[4, 11])
def residuals(request):
    return {
        name: residual(*pair) for name, pair in figure2.correlations(seed=request.param).items()
    }


def test_polynomial_leaves_at_most_two_per_cent(residuals):
    assert residuals["5th-order polynomial, 24 ms"] <= 2.0
    assert residuals["5th-order polynomial, 24 ms, behind a 30 Hz actuator"] <= 2.0


def test_filtered_blocks_leave_forty_per_cent_and_more(residuals):
    assert residuals["block filtered at 60 Hz"] >= 40.0
    assert residuals["block filtered at 30 Hz"] >= 40.0


def test_the_ideal_block_leaves_nothing_but_sampling(residuals):
    assert residuals["block"] <= 0.2


def measure(own, shape=None, seconds=240.0, **common):
    signal = PulseStep(Settings(shape=shape or Polynomial(), **common), **own)
    sign = -1.0 if signal.settings.direction == "plantarflexing" else 1.0
    samples = sign * signal.next(round(seconds * 2048))
    return residual(*cross_correlation(samples[:, 0], samples[:, 1], 2048.0))


def test_a_polynomial_pulse_of_forty_milliseconds_overlaps_its_own_velocity():
    assert measure({"balanced": True, "stretch": 0.0, "pulse_width": 0.04}) > 40.0


def test_the_property_holds_with_stretch_and_in_the_other_direction():
    assert measure({"balanced": True}) <= 2.0
    assert measure({"balanced": True}, direction="plantarflexing") <= 2.0


def test_both_directions_do_not_have_the_property():
    assert measure({"balanced": True}, direction="both") > 40.0


def test_whole_balanced_groups_have_the_property_whatever_the_order():
    balanced, random = (
        [measure({"balanced": b, "stretch": 0.0}, seconds=60.0, seed=s) for s in range(12)]
        for b in (True, False)
    )
    assert np.ptp(balanced) < 0.01
    assert max(balanced) < 0.5
    # With p the share of steps, the mean of the position is off by 0.096 (p - 1/2) from the mean
    # after a rise.
    assert 2 * max(balanced) < max(random) < 4.0


def test_cross_correlation_of_a_known_pair():
    rate = 100.0
    velocity = np.zeros(200)
    velocity[[50, 120]] = [2.0, -5.0]
    position = np.zeros(200)
    position[57] = 1.0
    lags, values = cross_correlation(position, velocity, rate)
    assert lags[0] == -0.1
    assert lags[-1] == 0.5
    expected = np.full(len(lags), 2.0 * -position.mean() / 200)
    expected[np.flatnonzero(np.isclose(lags, 0.07))] += 2.0 / 200
    np.testing.assert_allclose(values, expected, atol=1e-12)


def test_signals_too_short_for_the_lags_are_refused():
    with pytest.raises(ValueError, match="100 positions and 100 velocities do not allow lags"):
        cross_correlation(np.zeros(100), np.zeros(100), 2048.0)


def test_the_actuator_follows_slow_signals_and_damps_fast_ones():
    t = np.arange(20_000) / 2048.0
    gains = [
        np.ptp(figure2.behind_actuator(np.sin(2 * np.pi * f * t)[:, None])[10_000:]) / 2
        for f in (1.0, 30.0, 120.0)
    ]
    # |H| at f = bandwidth is 1 / (2 damping); at four times the bandwidth 1 / √(15² + (2·0.7·4)²).
    np.testing.assert_allclose(gains, [1.0, 1 / 1.4, 1 / np.hypot(15, 5.6)], rtol=0.02)


def test_the_picture_is_written_once(tmp_path, capsys):
    out = tmp_path / "figure2.png"
    assert figure2.main([str(out)]) == 0
    assert out.read_bytes()[:4] == b"\x89PNG"
    assert "behind a 30 Hz actuator" in capsys.readouterr().out
    before = out.read_bytes()
    assert figure2.main([str(out)]) == 1
    assert "--overwrite replaces it" in capsys.readouterr().err
    assert out.read_bytes() == before


def test_figure_shows_every_signal():
    above, below = figure2.figure(duration=20.0).axes
    assert len(above.lines) == 4
    assert len(below.lines) == 5
    block = above.lines[0].get_ydata()
    np.testing.assert_allclose(
        block, 1e3 * figure2.signal_of(Block(), figure2.SHOWN_DURATION)[:, 0]
    )
