"""Making a complete bag of what can be read of a damaged one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from session_recorder.bag_metadata import BLOCK_QOS
from session_recorder.bag_reader import BagReader
from session_recorder.bag_writer import BagWriter
from session_recorder.mcap_file import Progress


@dataclass(frozen=True)
class Recovery:
    """Holds the outcome of `recover`.

    Attributes
    ----------
    path
        The new bag.
    messages
        How many it holds.
    problems
        What was missing or damaged in the old one.
    """

    path: Path
    messages: int
    problems: tuple[str, ...]


def recover(
    path: Path | str, output: Path | str | None = None, progress: Progress | None = None
) -> Recovery:
    """Copy every readable message of a damaged bag into a new, complete one.

    The old bag stays as it is.

    Parameters
    ----------
    path
        Path of the damaged bag.
    output
        The new bag; by default the old name with ``_recovered``.
    progress
        Called with the fraction that is copied.

    Raises
    ------
    BagError
        Nothing readable is there, or the output exists.
    """
    reader = BagReader(path)
    target = (
        Path(output)
        if output is not None
        else reader.path.with_name(reader.path.stem + "_recovered")
    )
    total = max(reader.count, 1)
    with BagWriter(target) as writer:
        for topic in reader.topics.values():
            writer.add_topic(
                topic.name, topic.type, topic.qos or (BLOCK_QOS,), topic.type_hash or None
            )
        for number, (name, log_time, publish_time, data) in enumerate(reader.readable_messages()):
            writer.write(name, log_time, data, publish_time)
            if progress and number % 1000 == 0:
                progress(number / total)
        writer.custom_data.update(reader.custom_data)
        writer.custom_data["recovered"] = "; ".join(reader.problems) or "the source was complete"
    return Recovery(target, writer.count, tuple(reader.problems))
