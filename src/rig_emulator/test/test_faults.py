"""Fault switches, and what a faulty line and faulty sensors do with them."""

import re

import numpy as np
import pytest

from ankle_interfaces.errors import QuantityError
from rig_emulator.faults import Faults
from rig_emulator.faulty_line import OVERTAKING_DELAY, FaultyLine
from rig_emulator.faulty_sensors import (
    POSITION_RANGE,
    SPIKE_SIZE,
    SWING_SIZE,
    TORQUE_NOISE,
    TORQUE_RANGE,
    VELOCITY_RANGE,
    FaultySensors,
)

RATE = 2048.0
PACKETS = [bytes([number]) * 40 for number in range(200)]
PERIOD = 0.01  # s


def test_fault_switches_are_read_and_every_mistake_is_named():
    faults = Faults().with_switches("drop=0.1, freeze=1")
    assert (faults.drop, faults.freeze, faults.line()) == (0.1, 1.0, "drop=0.1,freeze=1")
    assert faults.with_switches("freeze=0").line() == "drop=0.1"
    assert faults.with_switches("none").line() == "none"
    for text, words in (
        ("explode=1", "unknown"),
        ("drop", "not 'drop=value'"),
        ("drop=2", "allowed: 0 to 1"),
        ("drop=nan", "refused"),
    ):
        with pytest.raises(QuantityError, match=words):
            faults.with_switches(text)


def test_every_switch_is_described_and_off_at_first():
    described = re.findall(r"^    (\w+)\n {8}", Faults.__doc__, re.MULTILINE)
    assert described == list(Faults.__dataclass_fields__)
    assert Faults().line() == "none"


def passed(switches):
    """Packets with the times at which they leave a line with these faults."""
    line = FaultyLine(seed=1)
    line.faults = Faults().with_switches(switches)
    out = []
    for step in range(3 * len(PACKETS)):
        if step < len(PACKETS):
            line.send(PACKETS[step], step * PERIOD)
        out += [(step * PERIOD, data) for data in line.due(step * PERIOD)]
    return out


def test_a_line_without_faults_gives_every_packet_at_once_and_in_order():
    assert passed("none") == [(number * PERIOD, data) for number, data in enumerate(PACKETS)]


def test_a_line_loses_and_doubles_the_stated_part_of_the_packets():
    assert 0.6 * len(PACKETS) < len(passed("drop=0.3")) < 0.8 * len(PACKETS)
    assert 1.2 * len(PACKETS) < len(passed("duplicate=0.3")) < 1.4 * len(PACKETS)
    assert passed("freeze=1") == []


def test_packets_that_others_overtake_come_late_and_none_is_lost():
    found = passed("reorder=0.3")
    order = [data for _, data in found]
    assert sorted(order) == PACKETS
    assert order != PACKETS
    late = [time - PACKETS.index(data) * PERIOD for time, data in found]
    assert max(late) == pytest.approx(OVERTAKING_DELAY, abs=PERIOD)


def test_a_damaged_packet_keeps_its_length_and_nothing_more():
    found = [data for _, data in passed("corrupt=1")]
    assert [len(data) for data in found] == [len(data) for data in PACKETS]
    assert all(data != sent for data, sent in zip(found, PACKETS, strict=True))


def test_a_burst_holds_the_packets_of_a_part_of_every_second():
    late = [time - PACKETS.index(data) * PERIOD for time, data in passed("burst=0.2")]
    assert max(late) == pytest.approx(0.2, abs=1.5 * PERIOD)
    assert np.median(late) < 1e-9


TRUE = np.column_stack([np.full(512, 0.01), np.full(512, 0.5), np.full(512, 3.0)])


def shown(switches, samples=TRUE):
    """What sensors with these faults make of samples, after a second without any."""
    sensors = FaultySensors(RATE, seed=1)
    sensors.change(np.column_stack([np.full(64, -0.02), np.zeros(64), np.ones(64)]), Faults())
    return sensors.change(samples, Faults().with_switches(switches))


def test_sensors_without_faults_show_the_truth_and_leave_it_alone():
    samples = TRUE.copy()
    np.testing.assert_array_equal(shown("none", samples), TRUE)
    shown("nan=1", samples)
    np.testing.assert_array_equal(samples, TRUE)


@pytest.mark.parametrize(
    ("switch", "column", "value"),
    [
        ("encoder_stuck", 0, -0.02),
        ("position_saturated", 0, POSITION_RANGE),
        ("velocity_stuck", 1, 0.0),
        ("velocity_saturated", 1, VELOCITY_RANGE),
        ("torque_stuck", 2, 1.0),
        ("torque_saturated", 2, TORQUE_RANGE),
        ("position_nan", 0, np.nan),
        ("velocity_nan", 1, np.nan),
        ("torque_nan", 2, np.nan),
    ],
)
def test_a_channel_that_fails_shows_one_value(switch, column, value):
    found = shown(f"{switch}=1")
    np.testing.assert_array_equal(found[:, column], np.full(len(found), value))
    others = [one for one in range(3) if one != column and (switch, one) != ("encoder_stuck", 1)]
    np.testing.assert_array_equal(found[:, others], TRUE[:, others])


@pytest.mark.parametrize(("column", "name"), list(enumerate(("encoder", "velocity", "torque"))))
def test_spikes_have_their_size_and_come_in_the_stated_part_of_the_samples(column, name):
    off = shown(f"{name}_spikes=0.1")[:, column] - TRUE[:, column]
    assert set(np.round(off, 9)) == {0.0, SPIKE_SIZE[column]}
    assert 0.05 < np.mean(off > 0) < 0.15


def test_torque_that_is_dead_swings_or_slips_is_as_large_as_it_is_said_to_be():
    assert shown("torque_dead=1")[:, 2].std() == pytest.approx(TORQUE_NOISE, rel=0.2)
    assert np.abs(shown("torque_swings=0.5")[:, 2]).max() == pytest.approx(
        0.5 * SWING_SIZE, rel=0.01
    )
    assert shown("encoder_slip=0.1")[:, 0] == pytest.approx(TRUE[:, 0] + 0.1)
