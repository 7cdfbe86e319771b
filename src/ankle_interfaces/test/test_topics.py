"""The topics: each fact once, and a new column that touches three files at most."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

from ankle_interfaces import topics
from ankle_interfaces.block import Block, pack, require_columns, select_columns, unpack
from ankle_interfaces.units import split_column, to_si

SOURCES = Path(__file__).parents[2]
INDEPENDENT_PACKAGES = ("blind_rig", "second_rig")
"""The independent rigs know formats and columns from their descriptions alone."""


def modules():
    for path in SOURCES.glob("*/*/**/*.py"):
        package = path.relative_to(SOURCES).parts[0]
        if path.relative_to(SOURCES).parts[1] == package and package not in INDEPENDENT_PACKAGES:
            yield path


def test_every_column_has_a_si_unit_and_every_topic_a_relative_name():
    assert len({topic.name for topic in topics.TOPICS}) == len(topics.TOPICS)
    for topic in topics.TOPICS:
        assert topic.description.endswith("."), topic.name
        assert topic.name.startswith("/") == (topic in (topics.DIAGNOSTICS, topics.CLOCK))
        for column in topic.columns:
            unit = split_column(column)[1]
            assert to_si(unit) == (unit, 1.0)
        assert set(topic.optional) <= set(topic.columns[1:])
        assert {column for column, _ in topic.plots} <= set(topic.columns)


def test_no_other_module_repeats_a_topics_name_or_its_columns():
    names = "|".join(f"/?{re.escape(topic.name)}" for topic in topics.TOPICS)
    name = re.compile(rf"""["']({names})["']""")
    several = [topic for topic in topics.TOPICS if len(topic.columns) > 3]
    found = []
    for path in modules():
        if path == SOURCES / "ankle_interfaces" / "ankle_interfaces" / "topics.py":
            continue
        text = path.read_text()
        found += [f"{path.name}: {match[0]}" for match in name.finditer(text)]
        for topic in several:
            columns = r",\s*".join(f'"{re.escape(column)}"' for column in topic.columns)
            if re.search(columns, text):
                found.append(f"{path.name}: columns of {topic.name}")
    assert found == []


@pytest.fixture
def with_extra_column():
    """`ANKLE_SAMPLES` with one more column, of a name that no rig has."""
    return dataclasses.replace(
        topics.ANKLE_SAMPLES,
        columns=(*topics.ANKLE_SAMPLES.columns, "sum_of_a_test[1]"),
        optional=(*topics.ANKLE_SAMPLES.optional, "sum_of_a_test[1]"),
    )


def test_a_new_column_reaches_who_wants_it_and_disturbs_nobody(with_extra_column):
    """The declaration, who measures and who reads: no other file is concerned."""
    row = [float(k) for k in range(len(with_extra_column.columns))]
    sent = pack(Block(with_extra_column.columns, np.array([row])))
    # A reader that was written before the column existed.
    old, notes = select_columns(
        unpack(sent),
        topics.ANKLE_SAMPLES.columns[1:],
        "/ankle/samples",
        topics.ANKLE_SAMPLES.optional,
    )
    assert old.columns == topics.ANKLE_SAMPLES.columns
    assert (old.data.tolist(), notes) == ([row[:-1]], [])
    # A reader that wants it, from a rig that has it and from one that has not.
    wanted = ("torque[N.m]", "sum_of_a_test[1]")
    new = require_columns(unpack(sent), wanted, "/ankle/samples", with_extra_column.optional)
    torque = with_extra_column.columns.index("torque[N.m]")
    assert new.data.tolist() == [[0.0, row[torque], row[-1]]]
    without = Block(topics.ANKLE_SAMPLES.columns, np.array([row[:-1]]))
    assert require_columns(
        without, wanted, "/ankle/samples", with_extra_column.optional
    ).columns == (
        "t[s]",
        "torque[N.m]",
    )


def test_a_topic_is_found_in_any_namespace():
    held = ["/ankle/samples", "/left/ankle/samples", "/left/broken_ankle/samples", "/clock"]
    assert topics.ANKLE_SAMPLES.among(held) == tuple(held[:2])


def test_the_documentation_has_every_topic_with_its_columns():
    """Columns that not every publisher has may stand in the generated reference alone."""
    page = SOURCES.parent / "docs" / "ros2.md"
    if not page.exists():
        pytest.skip("the documentation is not installed with the package")
    rows = {row.split(" | ")[0]: row for row in page.read_text().splitlines()}
    for topic in topics.TOPICS:
        row = rows[f"| `{topic.name}`"]
        assert topic.message.rpartition("/")[2] in row
        named = re.findall(r"[A-Za-z]\w*\[[^\]]*\]", row.split(" | ")[-1].partition(" of ")[0])
        assert set(topic.required) <= set(named)
        assert not topic.columns[1:] or set(named) <= set(topic.columns)
