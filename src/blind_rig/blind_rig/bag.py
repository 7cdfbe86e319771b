"""A recording becomes a bag with the laboratory's topics.

Nothing in it shows how it was made.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ankle_interfaces.block import Block
from blind_rig.trial import MUSCLES, Recording
from session_recorder.bag_writer import BagWriter

SAMPLES_TOPIC = "/ankle/samples"
REFERENCE_TOPIC = "/perturbation/reference"
EMG_TOPIC = "/emg/samples"
# Blocks of about 1/64 s, a power of two as a data-acquisition board delivers them.
BLOCK = {1000.0: 16, 2048.0: 32}
# Time of the first sample [s]: any plausible ROS time, the same for all bags so that it tells
# nothing.
START = 1_760_000_000.0


class Contents(NamedTuple):
    """Says what a laboratory happened to record: velocity column, reference, EMG."""

    velocity: bool
    reference: bool
    emg: bool


def write_bag(path: Path, recording: Recording, rate: float, contents: Contents) -> None:
    """Write a bag; one that is there from an interrupted run is replaced.

    Raises
    ------
    session_recorder.errors.BagError
        Something else is there, or the disk refuses.
    """
    t = START + recording.time
    motion = {
        "t[s]": t,
        "position[rad]": recording.position,
        "velocity[rad/s]": recording.velocity,
        "torque[N.m]": recording.torque,
    }
    if not contents.velocity:
        del motion["velocity[rad/s]"]
    streams = {SAMPLES_TOPIC: motion}
    if contents.reference:
        motions = ("position[rad]", "velocity[rad/s]", "acceleration[rad/s^2]")
        streams[REFERENCE_TOPIC] = {
            "t[s]": t,
            **dict(zip(motions, recording.reference.T, strict=True)),
        }
    if contents.emg:
        streams[EMG_TOPIC] = {
            "t[s]": t,
            **{
                f"{muscle}[V]": signal
                for muscle, signal in zip(MUSCLES, recording.emg.T, strict=True)
            },
        }
    tables = {
        topic: (tuple(columns.keys()), np.column_stack(list(columns.values())))
        for topic, columns in streams.items()
    }
    size = BLOCK[rate]
    with BagWriter(path, overwrite=True, chunk_seconds=float("inf")) as writer:
        for topic in tables:
            writer.add_topic(topic)
        for first in range(0, len(t), size):
            for topic, (names, data) in tables.items():
                writer.write_block(
                    topic, Block(names, np.ascontiguousarray(data[first : first + size]))
                )


def fingerprint(path: Path) -> str:
    """Return the SHA-256 over the bag's files, by name.

    It shows whether a bag was changed after it was sealed.
    """
    digest = hashlib.sha256()
    for file in sorted(p for p in Path(path).rglob("*") if p.is_file()):
        digest.update(
            file.relative_to(path).as_posix().encode()
            + b"\0"
            + hashlib.sha256(file.read_bytes()).digest()
        )
    return digest.hexdigest()
