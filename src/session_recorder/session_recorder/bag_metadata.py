"""``metadata.yaml`` of a rosbag2 directory, version 9 as ROS 2 Jazzy writes it."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2.metadata import dump_qos_v9, parse_qos

from ankle_interfaces.yaml_text import YamlError, parse_yaml, read_text
from session_recorder.errors import BagError

METADATA_FILE = "metadata.yaml"
VERSION = 9
ROOT = "rosbag2_bagfile_information"
# What rmw writes for "no deadline": the largest int64 of nanoseconds.
INFINITE_DURATION = QosTime(9223372036, 854775807)
# rosbag2's starting time of a bag without messages.
NO_TIME = 2**63 - 1
# libyaml's where it is there: the same text in a fifth of the time.
_DUMPER = yaml.CSafeDumper if yaml.__with_libyaml__ else yaml.SafeDumper


def qos(depth: int, reliable: bool = True, latched: bool = False) -> Qos:
    """Return keep-last QoS without deadlines; `latched` is transient local."""
    return Qos(
        QosHistory.KEEP_LAST,
        depth,
        QosReliability.RELIABLE if reliable else QosReliability.BEST_EFFORT,
        QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        INFINITE_DURATION,
        INFINITE_DURATION,
        QosLiveliness.AUTOMATIC,
        INFINITE_DURATION,
        False,
    )


# Stated for a topic of blocks where no publisher's own profile is known: reliable, the last 64.
BLOCK_QOS = qos(64)


@dataclass
class Topic:
    """Describes one topic of a bag.

    Attributes
    ----------
    name
        As ``/ankle/samples``.
    type
        As ``std_msgs/msg/Float64MultiArray``.
    qos
        What its publishers offered, each different profile once; empty where unknown.
    type_hash
        ``RIHS01_...``; empty where unknown.
    definition
        The stored schema text.
    count
        Messages.
    """

    name: str
    type: str
    qos: tuple[Qos, ...] = ()
    type_hash: str = ""
    definition: str = ""
    count: int = 0


@dataclass
class Contents:
    """Holds what ``metadata.yaml`` says about a bag: topics, counts, times [ns], files, free
    key-value pairs.
    """

    files: list[str]
    topics: list[Topic]
    start_ns: int = NO_TIME
    end_ns: int = 0
    custom_data: dict[str, str] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Return the number of messages of all topics."""
        return sum(topic.count for topic in self.topics)


def qos_text(profiles: Iterable[Qos]) -> str:
    """Return QoS profiles as the YAML text that MCAP channels carry."""
    return yaml.dump(dump_qos_v9(list(profiles)), Dumper=_DUMPER, sort_keys=False).strip()


def parse_qos_text(text: str) -> tuple[Qos, ...]:
    """Return QoS profiles from the YAML text that MCAP channels carry.

    Raises
    ------
    BagError
        It is no such text.
    """
    try:
        return tuple(parse_qos(parse_yaml(text) or []))
    except (YamlError, KeyError, TypeError, AttributeError) as error:
        raise BagError(f"not a list of QoS profiles: {' '.join(str(error).split())}") from None


def information(contents: Contents) -> dict[str, Any]:
    """Return the mapping under ``rosbag2_bagfile_information``."""
    duration = max(0, contents.end_ns - contents.start_ns) if contents.count else 0
    times: dict[str, Any] = {
        "duration": {"nanoseconds": duration},
        "starting_time": {
            "nanoseconds_since_epoch": contents.start_ns if contents.count else NO_TIME
        },
        "message_count": contents.count,
    }
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        **times,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": dump_qos_v9(list(topic.qos)),
                    "type_description_hash": topic.type_hash,
                },
                "message_count": topic.count,
            }
            for topic in contents.topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": list(contents.files),
        "files": [{"path": file, **times} for file in contents.files],
        "custom_data": dict(contents.custom_data) or None,
        "ros_distro": os.environ.get("ROS_DISTRO", "jazzy"),
    }


def metadata_text(info: Mapping[str, Any]) -> str:
    """Return the YAML text of a mapping, in its order and without aliases."""
    return yaml.dump(
        _plain(info),
        Dumper=type("Plain", (_DUMPER,), {"ignore_aliases": lambda self, data: True}),
        sort_keys=False,
    )


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value


def read_metadata(folder: Path) -> Contents:
    """Read the folder's ``metadata.yaml``.

    Raises
    ------
    BagError
        It is not readable, not YAML, of another storage, misses an entry, or holds no number where
        one belongs.
    """
    path = folder / METADATA_FILE
    try:
        info = parse_yaml(read_text(path))[ROOT]
        storage = info["storage_identifier"]
        if storage != "mcap":
            raise BagError(
                f"{path}: storage '{storage}' is not read here; convert it: ros2 bag convert "
                "(storage_id: mcap)"
            )
        if info.get("compression_mode") or info.get("compression_format"):
            raise BagError(
                f"{path}: the bag is compressed by rosbag2 ('{info.get('compression_mode')}'); "
                "MCAP with zstd chunks is expected"
            )
        topics = []
        for entry in info["topics_with_message_count"]:
            about = entry["topic_metadata"]
            profiles = tuple(parse_qos(about.get("offered_qos_profiles") or []))
            topics.append(
                Topic(
                    about["name"],
                    about["type"],
                    profiles,
                    about.get("type_description_hash", ""),
                    "",
                    _whole_number(entry, "message_count", path),
                )
            )
        start = _whole_number(info["starting_time"], "nanoseconds_since_epoch", path)
        end = start + _whole_number(info["duration"], "nanoseconds", path)
        custom = {str(key): str(value) for key, value in (info.get("custom_data") or {}).items()}
        return Contents(
            [Path(file).name for file in info["relative_file_paths"]], topics, start, end, custom
        )
    except OSError as error:
        raise BagError(f"{path}: {error.strerror}") from None
    except YamlError as error:
        raise BagError(f"{path} is not YAML: {' '.join(str(error).split())}") from None
    except (KeyError, TypeError, AttributeError) as error:
        raise BagError(
            f"{path} is not a rosbag2 description: {error!r} is missing or of another kind"
        ) from None


def _whole_number(entry: Mapping[str, Any], name: str, path: Path) -> int:
    """Return a count, a time or a duration of a bag's description."""
    try:
        return int(entry[name])
    except (ValueError, OverflowError):
        raise BagError(
            f"{path} is not a rosbag2 description: '{name}' is '{entry[name]}' and no whole number"
        ) from None
