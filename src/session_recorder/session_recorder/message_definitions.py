"""Definitions and hashes of ROS message types, without a ROS installation being sourced.

Jazzy's own types come with `rosbags`; any other type that the graph uses is read from the
``.msg`` files of the installation that provides it.
"""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from session_recorder.errors import BagError


@dataclass(frozen=True)
class Definition:
    """Holds the definition of a message type as a bag stores it.

    Attributes
    ----------
    text
        The ``ros2msg`` schema: the type's own definition followed by every nested one.
    type_hash
        ``RIHS01_...`` (REP 2016), as the graph reports it.
    """

    text: str
    type_hash: str


@lru_cache(maxsize=1)
def typestore() -> Typestore:
    """Return every type of ROS 2 Jazzy, and those that `definition` found elsewhere."""
    return get_typestore(Stores.ROS2_JAZZY)


@lru_cache(maxsize=256)
def definition(message_type: str) -> Definition:
    """Return the full definition of a type, as ``std_msgs/msg/Float64MultiArray``.

    Raises
    ------
    BagError
        Neither Jazzy nor an installed package defines the type.
    """
    store = typestore()
    if message_type not in store.fielddefs:
        _register_installed(store, message_type)
    text, _ = store.generate_msgdef(message_type, ros_version=2)
    return Definition(text, store.hash_rihs01(message_type))


def _register_installed(store: Typestore, message_type: str) -> None:
    types = {}
    pending = [message_type]
    while pending:
        name = pending.pop()
        if name in types or name in store.fielddefs:
            continue
        found = get_types_from_msg(_installed_file(name).read_text(), name)
        types.update(found)
        for _, fields in found.values():
            pending += [
                nested for _, description in fields if (nested := _nested_type(description))
            ]
    store.register(types)


def _nested_type(description: tuple) -> str | None:
    """Return the message type that a field holds: itself, or as the element of an array."""
    content = description[1]
    while isinstance(content, tuple) and isinstance(content[0], tuple):
        content = content[0][1]
    return content if isinstance(content, str) else None


def _installed_file(message_type: str) -> Path:
    parts = message_type.split("/")
    if len(parts) == 3:
        prefixes = [
            *filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)),
            sys.prefix,
        ]
        for prefix in prefixes:
            path = Path(prefix, "share", parts[0], parts[1], parts[2] + ".msg")
            if path.is_file():
                return path
    raise BagError(
        f"no definition of message type '{message_type}': it is not part of ROS 2 Jazzy, and no "
        "installed package has it"
    )
