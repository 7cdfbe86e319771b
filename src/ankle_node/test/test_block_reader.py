"""What a reader of blocks hands on, and what it reports about messages that are wrong."""

import numpy as np
import pytest
from rclpy.serialization import serialize_message

from ankle_interfaces.block import Block, pack
from ankle_interfaces.topics import ANKLE_SAMPLES, IMPEDANCE_ESTIMATE
from ankle_node.block_reader import BlockReader, Defect

COLUMNS = ("t[s]", "position[deg]", "torque[N.m]")


@pytest.fixture
def heard():
    return {"blocks": [], "reports": []}


@pytest.fixture
def reader(heard):
    return BlockReader(
        "/ankle/samples",
        ("position[rad]",),
        (),
        lambda block, findings: heard["blocks"].append((block, findings)),
        lambda *report: heard["reports"].append(report),
    )


def message(begin, columns=COLUMNS):
    time = begin + np.arange(4) / 100.0
    data = np.column_stack([time, np.full(4, 180.0), np.ones(4)])[:, : len(columns)]
    packed = pack(Block(columns, data))
    return packed if isinstance(packed, bytes) else serialize_message(packed)


def test_a_reader_gets_its_columns_in_si_and_a_unit_is_noted_once_as_new(reader, heard):
    reader.take(message(0.0))
    reader.take(message(0.04))
    block, findings = heard["blocks"][1]
    assert block.columns == ("t[s]", "position[rad]")
    assert block.data[:, 1] == pytest.approx(np.pi)
    assert findings == []
    assert [(defect, first) for defect, _, first in heard["reports"]] == [
        (Defect.UNIT, True),
        (Defect.UNIT, False),
    ]


def test_a_block_without_a_wanted_column_is_reported_by_name_and_dropped(reader, heard):
    reader.take(message(0.0, ("t[s]", "torque[N.m]")))
    assert heard["blocks"] == []
    ((defect, sentence, first),) = heard["reports"]
    assert defect is Defect.BLOCK
    assert sentence.startswith("/ankle/samples")
    assert "position[rad]" in sentence
    assert first


@pytest.mark.parametrize(("topic", "reports"), [(IMPEDANCE_ESTIMATE, 0), (ANKLE_SAMPLES, 1)])
def test_nan_before_the_first_estimate_is_no_warning_but_in_samples_it_is(topic, reports):
    heard = []
    columns = ("K[N.m/rad]",)
    reader = BlockReader(
        topic.absolute, columns, (), lambda *_: None, lambda *r: heard.append(r), topic.sparse
    )
    block = pack(Block(("t[s]", *columns), np.array([[0.0, np.nan], [0.01, np.nan]])))
    reader.take(block if isinstance(block, bytes) else serialize_message(block))
    assert len(heard) == reports


def test_a_gap_reaches_the_reader_and_the_report_and_is_counted(reader, heard):
    for begin in (0.0, 0.04, 0.12):
        reader.take(message(begin, ("t[s]", "position[rad]")))
    findings = heard["blocks"][2][1]
    assert len(findings) == 1
    assert [defect for defect, *_ in heard["reports"]] == [Defect.STREAM]
    assert reader.continuity.missing == 4
