"""Damaged messages in the graph, and descriptions of an amplifier's stream."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import yaml

from ankle_interfaces.block import LARGEST_PADDING, Block, pack, require_columns, unpack
from ankle_interfaces.continuity import Continuity
from ankle_interfaces.errors import BlockError, UnitError
from ankle_node import session_event
from damaged_input.damage import (
    ROS,
    Case,
    damaged,
    number,
    text_of,
    word,
)
from emg_driver.errors import StreamRefused
from emg_driver.stream_description import StreamDescription, map_channels


def blocks(folder: Path) -> Case:
    """Messages of a topic of samples."""
    continuity, count = Continuity(), [0]

    def case(random: np.random.Generator) -> bool:
        count[0] += 1
        t = ROS + (32 * count[0] + np.arange(32)) / 2048
        data = np.column_stack([t, np.sin(t)])
        if random.random() < 0.2:
            data[int(random.integers(32)), int(random.integers(2))] = number(random)
        message = pack(Block(("t[s]", "torque[N.m]"), data))
        if random.random() < 0.8:
            message = damaged(message, random)
        try:
            block = require_columns(unpack(message), ("torque[N.m]",), "ankle/samples")
        except (BlockError, UnitError):
            return False
        assert block.data.shape[1] == 2
        assert abs(len(pack(unpack(message))) - len(message)) <= LARGEST_PADDING
        with np.errstate(all="ignore"):
            found = {finding.kind for finding in continuity.check(block.data)}
        assert np.isfinite(block.data).all() or "not_finite" in found
        return True

    return case


def session_events(folder: Path) -> Case:
    """Lines on session/event."""
    good = {"event": "hold started", "t[s]": ROS, "hold": 3, "torque_target[N.m]": -5.0}

    def case(random: np.random.Generator) -> bool:
        text = text_of(good, random, lambda c: yaml.safe_dump(c, default_flow_style=True))
        try:
            found = session_event.parse(text.decode("utf-8", "replace"))
        except session_event.SessionEventError:
            return False
        assert math.isfinite(found.time)
        return True

    return case


def stream_descriptions(folder: Path) -> Case:
    """What an amplifier says of itself over LSL."""
    labels, units = ("SOL", "TA", "GL", "GM"), ("uV", "mV", "V", "nV")

    def case(random: np.random.Generator) -> bool:
        count = int(random.integers(0, 7))
        pick = [
            labels[int(random.integers(4))] if random.random() < 0.8 else word(random)
            for _ in range(count)
        ]
        names = labels if random.random() < 0.5 else tuple(pick)
        unit = tuple(
            units[int(random.integers(4))] if random.random() < 0.9 else word(random) for _ in names
        )
        stream = StreamDescription(
            word(random),
            "EMG",
            word(random),
            word(random),
            number(random, 2048.0, 2048.0, 2000.0, 1000.0),
            names,
            unit,
        )
        channels = "SOL=SOL,TA=TA,GL=GL,GM=GM"
        if random.random() < 0.4:
            channels = damaged(channels.encode(), random).decode("utf-8", "replace")
        try:
            found = map_channels(stream, channels, "" if random.random() < 0.7 else word(random))
        except StreamRefused:
            return False
        assert found.index.min() >= 0
        assert found.index.max() < len(names)
        assert np.all((found.to_volts > 0) & (found.to_volts <= 1))
        return True

    return case
