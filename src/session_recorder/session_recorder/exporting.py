"""Bags into CSV and NPZ, for programs that read neither MCAP nor ROS messages."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from rosbags.typesys.store import Typestore

from ankle_interfaces.block import MESSAGE_TYPE
from session_recorder.bag_reader import BagReader
from session_recorder.errors import BagError
from session_recorder.mcap_file import Progress
from session_recorder.message_definitions import definition, typestore

FORMATS = ("csv", "npz")
LOG_TIME = "log_time[s]"


def export_bag(
    bag: Path | str,
    output: Path | str,
    file_format: str,
    *,
    topics: Collection[str] | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> list[Path]:
    """Export a bag.

    ``csv`` writes a folder with one file for each topic: blocks as one row for each sample under
    the column names with units, with every digit; any other message as its log time and one JSON
    object. ``npz`` writes one file; every column of a block topic is an array
    ``ankle_samples.position[rad]``.

    Parameters
    ----------
    bag
        The bag that is read.
    output
        The folder (``csv``) or file (``npz``) to write.
    file_format
        Format of the files: ``csv`` or ``npz``.
    topics
        Names; None exports every topic (``npz``: every topic of blocks).
    overwrite
        Replace files that are there.
    progress
        Called with the fraction that is done.

    Returns
    -------
    list[Path]
        The files written.

    Raises
    ------
    BagError
        No such bag or topic, a message that is no valid block, an existing output, a bag as
        output, a disk that refuses.
    """
    if file_format not in FORMATS:
        raise BagError(f"format '{file_format}' is not written; expected {' or '.join(FORMATS)}")
    reader = BagReader(bag)
    names = list(topics) if topics is not None else sorted(reader.topics)
    for name in names:
        reader.topic(name)
    if file_format == "npz" and topics is None:
        names = [name for name in names if reader.topics[name].type == MESSAGE_TYPE]
    if not names:
        raise BagError(f"{reader.path} holds nothing that can be written as {file_format}")
    target = Path(output)
    try:
        return (_export_csv if file_format == "csv" else _export_npz)(
            reader, target, names, overwrite, progress
        )
    except OSError as error:
        raise BagError(f"cannot write {target}: {error.strerror}") from None


def _file_name(topic: str) -> str:
    return topic.strip("/").replace("/", "_")


def _require_free(folder: Path, overwrite: bool) -> None:
    """Refuse the folder of a bag, and one with something in it that may not be replaced."""
    held = [path.name for path in folder.iterdir()]
    if any(name == "metadata.yaml" or name.endswith(".mcap") for name in held):
        raise BagError(f"{folder} is a bag, into which no tables are written; give another --out")
    if held and not overwrite:
        raise BagError(
            f"{folder} is not empty; give another --out, or replace tables there with --overwrite"
        )


def _share(progress: Progress | None, number: int, count: int) -> Progress | None:
    if progress is None:
        return None
    return lambda fraction: progress((number + fraction) / count)


def _export_npz(
    reader: BagReader, target: Path, names: list[str], overwrite: bool, progress: Progress | None
) -> list[Path]:
    if target.exists() and not overwrite:
        raise BagError(f"{target} is there already; replace it with --overwrite")
    arrays: dict[str, np.ndarray] = {}
    for number, topic in enumerate(names):
        columns, data = reader.signal(topic, _share(progress, number, len(names)))
        arrays.update(
            {f"{_file_name(topic)}.{column}": data[:, k] for k, column in enumerate(columns)}
        )
    target.parent.mkdir(parents=True, exist_ok=True)
    with target.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
    return [target]


def _export_csv(
    reader: BagReader, target: Path, names: list[str], overwrite: bool, progress: Progress | None
) -> list[Path]:
    files = {topic: target / f"{_file_name(topic)}.csv" for topic in names}
    if len(set(files.values())) < len(files):
        raise BagError(f"two topics would be written to the same file: {', '.join(names)}")
    if target.is_dir():
        _require_free(target, overwrite)
    target.mkdir(parents=True, exist_ok=True)
    for number, (topic, path) in enumerate(files.items()):
        share = _share(progress, number, len(files))
        with path.open("w", encoding="utf-8", newline="") as file:
            write: Callable[[BagReader, str, TextIO, Progress | None], None] = (
                _write_blocks if reader.topics[topic].type == MESSAGE_TYPE else _write_messages
            )
            write(reader, topic, file, share)
    return list(files.values())


def _write_blocks(reader: BagReader, topic: str, file: TextIO, progress: Progress | None) -> None:
    columns: tuple[str, ...] | None = None
    for block in reader.blocks(topic, progress=progress):
        if columns is None:
            columns = block.columns
            file.write(",".join(columns) + "\n")
        elif block.columns != columns:
            raise BagError(
                f"{reader.path}: {topic} changes its columns from {', '.join(columns)} to "
                f"{', '.join(block.columns)}"
            )
        # repr is the shortest text that reads back as the same number.
        file.writelines(",".join(map(repr, row)) + "\n" for row in block.data.tolist())


def _write_messages(reader: BagReader, topic: str, file: TextIO, progress: Progress | None) -> None:
    message_type = reader.topics[topic].type
    definition(message_type)
    store = typestore()
    rows = csv.writer(file, lineterminator="\n")
    rows.writerow([LOG_TIME, message_type])
    for _, log_time, message in reader.messages((topic,), progress):
        content = _plain(store.deserialize_cdr(message, message_type), store)
        rows.writerow(
            [f"{log_time // 10**9}.{log_time % 10**9:09d}", json.dumps(content, ensure_ascii=False)]
        )


def _plain(value: Any, store: Typestore) -> Any:
    """Return a message as what JSON knows."""
    if hasattr(value, "__msgtype__"):
        return {
            name: _plain(getattr(value, name), store)
            for name, _ in store.fielddefs[value.__msgtype__][1]
        }
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return [_plain(item, store) for item in value]
    return value.item() if isinstance(value, np.generic) else value
