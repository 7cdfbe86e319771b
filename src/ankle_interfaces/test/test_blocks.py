"""The block format against rclpy's own serialisation, and against damage."""

import numpy as np
import pytest

from ankle_interfaces.block import Block, _layout, pack, require_columns, unpack
from ankle_interfaces.continuity import Continuity, sampling_rate
from ankle_interfaces.errors import BlockError, UnitError
from ankle_interfaces.resampling import resample

COLUMNS = ("t[s]", "position[rad]", "velocity[rad/s]", "torque[N.m]")


def block_of(n, columns=COLUMNS, start=1.7e9):
    rng = np.random.default_rng(n)
    data = rng.normal(size=(n, len(columns)))
    data[:, 0] = start + np.arange(n) / 2048
    return Block(tuple(columns), data)


@pytest.mark.parametrize("n", [0, 1, 2, 32, 511])
@pytest.mark.parametrize(
    "columns", [("t[s]",), ("t[s]", "a[1]"), COLUMNS, ("t[s]", "SOL[V]", "TA[V]", "GL[V]", "GM[V]")]
)
def test_bytes_are_those_of_rclpy(n, columns):
    from rclpy.serialization import deserialize_message, serialize_message
    from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

    block = block_of(n, columns)
    m = len(columns)
    dimensions = [
        MultiArrayDimension(label="sample", size=n, stride=n * m),
        MultiArrayDimension(label=",".join(columns), size=m, stride=m),
    ]
    message = Float64MultiArray(
        layout=MultiArrayLayout(dim=dimensions), data=block.data.ravel().tolist()
    )
    assert unpack(serialize_message(message)).data.tolist() == block.data.tolist()
    assert unpack(serialize_message(message)).columns == tuple(columns)
    assert deserialize_message(pack(block), Float64MultiArray) == message


def test_round_trip_keeps_every_bit():
    block = block_of(32)
    assert unpack(pack(block)).data.tobytes() == block.data.tobytes()


@pytest.mark.parametrize("columns", [COLUMNS, ("t[s]", "a[1]"), ("t[s]", "aa[1]")])
def test_the_layout_of_a_topic_is_read_once(columns):
    _layout.cache_clear()
    for k in range(10):
        unpack(pack(block_of(32, columns, start=float(k))))
    assert _layout.cache_info().misses == 1


def test_every_cut_message_is_refused():
    message = pack(block_of(3))
    for length in range(len(message)):
        with pytest.raises(BlockError):
            unpack(message[:length])


def test_a_message_with_bytes_put_in_is_refused_and_padding_is_not():
    message = pack(Block(("t[s]", "torque[N.m]"), np.ones((3, 2))))
    assert len(unpack(message + bytes(7)).data) == 3
    for at in (len(message) - 20, len(message)):
        with pytest.raises(BlockError, match="8 bytes behind its samples"):
            unpack(message[:at] + bytes(8) + message[at:])


def test_layout_that_contradicts_the_data_is_named():
    message = pack(block_of(4))
    wrong = message.replace((16).to_bytes(4, "little"), (12).to_bytes(4, "little"), 1)
    with pytest.raises(BlockError, match="contradicts"):
        unpack(wrong)


def test_degrees_and_millinewton_metres_are_converted_and_said():
    block = Block(("t[s]", "position[deg]", "torque[mN.m]"), np.array([[0.0, 180.0, 2000.0]]))
    si, notes = block.in_si()
    assert si.data[0].tolist() == pytest.approx([0.0, np.pi, 2.0])
    assert len(notes) == 2
    assert "position[deg]" in notes[0]
    assert require_columns(block, ("torque[N.m]",), "/x").data[0].tolist() == pytest.approx(
        [0.0, 2.0]
    )


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        (("t[s]", "torque[ft.lbf]"), "unknown unit 'ft.lbf'"),
        (("t[s]", "torque[rad]"), "torque comes in 'rad'"),
        (("t[s]", "torque"), "does not say its unit"),
    ],
)
def test_wrong_units_are_refused(columns, words):
    with pytest.raises(UnitError, match=words.replace(".", r"\.")):
        require_columns(Block(columns, np.zeros((1, 2))), ("torque[N.m]",), "/ankle/samples")


def test_missing_column_is_named():
    with pytest.raises(BlockError, match=r"/ankle/samples: no column 'velocity\[rad/s\]'"):
        require_columns(
            block_of(2, ("t[s]", "torque[N.m]")), ("velocity[rad/s]",), "/ankle/samples"
        )


def test_a_clean_stream_has_no_findings():
    continuity = Continuity()
    whole = block_of(3200).data
    assert [continuity.check(whole[k : k + 32]) for k in range(0, 3200, 32)] == [[]] * 100
    assert continuity.rate == 2048.0


def test_gap_backwards_and_nan_are_found():
    continuity = Continuity()
    data = block_of(320).data
    continuity.check(data[:32])
    (gap,) = continuity.check(data[96:128])
    assert (gap.kind, gap.missing, continuity.missing) == ("gap", 64, 64)
    (back,) = continuity.check(data[32:64])
    assert back.kind == "backwards"
    damaged = data[64:96].copy()
    damaged[3, 2] = np.nan
    (bad,) = continuity.check(damaged)
    assert bad.kind == "not_finite"
    assert continuity.check(data[96:128]) == []


def test_nan_is_no_damage_where_a_value_may_not_exist():
    estimates = Continuity(rate=100.0, sparse=True)
    data = np.column_stack([np.arange(4) / 100.0, [np.nan, np.nan, 90.0, np.inf]])
    (bad,) = estimates.check(data)
    assert bad.message.startswith("1 of 4 samples")
    assert estimates.check(np.array([[0.04, np.nan], [0.05, 90.0]])) == []
    assert [finding.kind for finding in estimates.check(np.array([[np.nan, 90.0]]))] == [
        "not_finite"
    ]


def test_a_changed_rate_is_found():
    continuity = Continuity(rate=2048.0)
    assert {f.kind for f in continuity.check(np.arange(32)[:, None] / 2200.0)} == {"rate"}


@pytest.mark.parametrize("rate", [500.0, 1000.0, 2048.0, 10000.0, 1234.5])
def test_sampling_rate_from_times_of_today(rate):
    assert sampling_rate(1.8e9 + np.arange(64) / rate) == pytest.approx(rate, rel=1e-4)


@pytest.mark.parametrize("step", [5e-324, np.nan])
def test_steps_that_are_no_interval_are_refused(step):
    with pytest.raises(ValueError, match="median step"):
        sampling_rate(step * np.arange(1.0, 5.0))


def test_a_first_block_that_ends_at_an_infinite_time_is_reported():
    endless = np.array([[0.0], [np.inf]])
    continuity = Continuity()
    assert [one.kind for one in continuity.check(endless)] == ["not_finite", "backwards"]
    assert continuity.check(np.arange(32)[:, None] / 2048.0) == []
    assert continuity.rate == 2048.0


def test_resampling_keeps_a_band_limited_signal():
    t = np.arange(4000) / 1000.0
    fine = np.arange(int(4000 * 2.048)) / 2048.0
    signal = np.sin(2 * np.pi * 37.0 * t) + 5.0
    expected = np.sin(2 * np.pi * 37.0 * fine) + 5.0
    middle = slice(500, -500)
    assert np.abs(resample(signal, 1000.0, 2048.0) - expected)[middle].max() < 1e-3
