"""Signals that pass a limit are refused, with value, unit and limit."""

import pytest

from ankle_interfaces.errors import QuantityError
from perturbation_generator.edges import Block, Filtered, Polynomial
from perturbation_generator.limits import LIMIT_PARAMETERS, LimitError, Limits, limits_from
from perturbation_generator.multisine import Multisine
from perturbation_generator.prbs import Prbs
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings


def test_the_defaults_allow_the_paper_signal_and_its_30_hz_block():
    for shape in (Polynomial(), Filtered(30.0)):
        Limits().check(PulseStep(Settings(shape=shape)), 0.04)


@pytest.mark.parametrize(
    ("shape", "amplitude", "limits", "words"),
    [
        (
            Polynomial(),
            0.15,
            Limits(velocity=1e3, acceleration=1e5),
            "amplitude of 0.15 rad passes the limit of 0.14 rad",
        ),
        (
            Polynomial(),
            0.04,
            Limits(velocity=3.0),
            "velocity of 3.125 rad/s passes the limit of 3 rad/s",
        ),
        (
            Polynomial(),
            0.04,
            Limits(acceleration=400.0),
            "acceleration of 400.9 rad/s^2 passes the limit of 400 rad/s^2",
        ),
        (Filtered(60.0), 0.04, Limits(), "velocity of 6.916 rad/s passes the limit of 5 rad/s"),
        # The overshoot counts: 4.6 % at a damping of 0.7.
        (
            Filtered(30.0),
            0.04,
            Limits(amplitude=0.041),
            "amplitude of 0.04213 rad passes the limit of 0.041 rad",
        ),
        # A block is judged by its step per sample: 0.04 rad in 1 / 2048 s.
        (Block(), 0.04, Limits(), "velocity of 81.92 rad/s passes the limit of 5 rad/s"),
    ],
)
def test_what_passes_a_limit_is_refused(shape, amplitude, limits, words):
    with pytest.raises(LimitError) as refusal:
        limits.check(PulseStep(Settings(shape=shape)), amplitude)
    assert words in str(refusal.value)
    assert isinstance(refusal.value, QuantityError)


def test_a_value_at_the_limit_is_allowed():
    signal = PulseStep(Settings())
    at = signal.extremes(0.04)
    Limits(at.position, at.velocity, at.acceleration).check(signal, 0.04)
    with pytest.raises(LimitError):
        Limits(at.position, at.velocity, at.acceleration).check(signal, 0.0401)


def test_a_block_within_wide_limits_is_allowed():
    Limits(velocity=100.0, acceleration=2e5).check(PulseStep(Settings(shape=Block())), 0.04)


def test_a_sequence_between_both_sides_counts_twice():
    limits = Limits(velocity=4.0)
    limits.check(Prbs(Settings()), 0.04)
    with pytest.raises(LimitError, match=r"velocity of 6\.25 rad/s"):
        limits.check(Prbs(Settings(direction="both")), 0.04)


def test_a_multisine_of_high_frequency_is_refused():
    with pytest.raises(LimitError, match="signal 'multisine'"):
        Limits().check(Multisine(Settings(direction="both"), highest=100.0), 0.04)


def test_limits_from_parameter_values():
    values = {parameter.name: parameter.default for parameter in LIMIT_PARAMETERS} | {
        "velocity_limit": 7.0
    }
    assert limits_from(values) == Limits(velocity=7.0)
