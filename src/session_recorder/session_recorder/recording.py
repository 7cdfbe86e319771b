"""A recording in progress: the bag, what each topic brought, what is missing; without ROS."""

from __future__ import annotations

import math
import shutil
import time
from collections.abc import Collection, Mapping
from pathlib import Path

from rosbags.interfaces import Qos

from ankle_interfaces.block import MESSAGE_TYPE
from session_recorder.bag_writer import BagWriter
from session_recorder.loss import LOST_MESSAGES_KEY, LossAccount
from session_recorder.message_numbers import MessageNumbers


class Recording:
    """Writes messages into a bag, and keeps account of what is missing.

    Parameters
    ----------
    path
        Path of the new bag.

    Attributes
    ----------
    bag
        Its writer.
    account
        What is missing so far.
    warnings
        What went wrong, with the time [s since the start].
    """

    def __init__(self, path: Path | str) -> None:
        self.bag = BagWriter(path)
        self.account = LossAccount()
        self.warnings: list[str] = []
        self._numbers: dict[str, MessageNumbers] = {}
        self._mixed: set[tuple[str, str]] = set()
        self._began = time.monotonic()

    @property
    def duration(self) -> float:
        """Return the time since the start [s]."""
        return time.monotonic() - self._began

    def add_topic(self, topic: str, message_type: str, qos: Collection[Qos]) -> None:
        """Announce a topic.

        Raises
        ------
        BagError
            See `BagWriter.add_topic`.
        """
        self.bag.add_topic(topic, message_type, qos)

    def set_publishers(self, topic: str, publishers: Mapping[str, str]) -> str | None:
        """State who publishes a topic now.

        Parameters
        ----------
        topic
            Absolute name of the topic.
        publishers
            Name of the node by the publisher's identity.

        Returns
        -------
        str | None
            A sentence as long as a topic of samples has more than one publisher. The bag notes
            each such sentence once.
        """
        self._numbers.setdefault(topic, MessageNumbers()).set_publishers(publishers)
        if len(publishers) < 2 or topic not in self.account.topics:
            return None
        names = ", ".join(sorted(publishers.values()))
        sentence = f"{len(publishers)} nodes publish it ({names}); their samples are mixed"
        if (topic, sentence) not in self._mixed:
            self._mixed.add((topic, sentence))
            self.note(f"{topic}: {sentence}")
        return sentence

    def write(
        self,
        topic: str,
        stamp_ns: int,
        message: bytes,
        publish_ns: int | None = None,
        sequence: int | None = None,
    ) -> list[str]:
        """Write a message, and say what is wrong in its stream.

        Parameters
        ----------
        topic
            A topic that was announced.
        stamp_ns, publish_ns
            Times of reception and publication [ns].
        message
            The message as CDR bytes.
        sequence
            The message's number at its publisher, None where it is not known.

        Returns
        -------
        list[str]
            A sentence for each gap, step back in time or damaged value; mostly empty.

        Raises
        ------
        BagError
            See `BagWriter.write`.
        """
        self.bag.write(topic, stamp_ns, message, publish_ns)
        found = []
        if self.bag.topics[topic].type == MESSAGE_TYPE:
            found = self.account.add(topic, message, stamp_ns)
        if sequence is not None and topic not in self.account.topics:
            numbers = self._numbers.setdefault(topic, MessageNumbers())
            numbers.add(sequence, time.monotonic())
        for sentence in found:
            self.note(f"{topic}: {sentence}")
        return found

    def settle(self, final: bool = False) -> dict[str, str]:
        """Decide which messages without samples were lost; call it once in a while.

        Parameters
        ----------
        final
            Decide on everything, because nothing more will come.

        Returns
        -------
        dict[str, str]
            A sentence for each topic of which more messages are now known to be lost.
        """
        found = {}
        for topic, numbers in self._numbers.items():
            lost = numbers.settle(math.inf if final else time.monotonic())
            if numbers.lost:
                self.account.lost_messages[topic] = numbers.lost
            if lost:
                found[topic] = f"{lost} message(s) were lost on the way to the recorder"
                self.note(f"{topic}: {found[topic]}")
        return found

    def note(self, sentence: str) -> None:
        """Store a sentence with the bag."""
        self.warnings.append(f"{self.duration:.1f} s: {sentence}")

    def free_space(self) -> float:
        """Return free space on the bag's disk [MB]."""
        return shutil.disk_usage(self.bag.path).free / 1e6

    def figures(self) -> dict[str, int]:
        """Return what was recorded and what is missing, by names for ``/diagnostics``."""
        account = self.account
        return {
            "messages": self.bag.count,
            "missing samples": account.missing,
            **{f"{name} missing samples": held.missing for name, held in account.topics.items()},
            "lost messages": account.missing_messages,
        }

    def summary(self) -> str:
        """Return one line: messages, topics, duration, missing samples, path."""
        missing = {topic: held.missing for topic, held in self.account.topics.items()}
        where = ", ".join(f"{topic} {count}" for topic, count in missing.items() if count)
        return (
            f"recorded {self.bag.count} messages of {len(self.bag.topics)} topics in "
            f"{self.duration:.1f} s, "
            f"{self.account.missing} samples missing{f' ({where})' if where else ''}, "
            f"{self.account.missing_messages} messages lost: {self.bag.path}"
        )

    def close(self) -> None:
        """Finish the bag; what is missing is stored in it.

        Raises
        ------
        BagError
            The disk refuses.
        """
        self.settle(final=True)
        custom = self.bag.custom_data
        custom["missing_samples"] = str(self.account.missing)
        custom["lost_messages"] = str(self.account.missing_messages)
        for topic, held in self.account.topics.items():
            custom[f"missing_samples {topic}"] = str(held.missing)
        for topic, count in self.account.lost_messages.items():
            custom[f"{LOST_MESSAGES_KEY}{topic}"] = str(count)
        if self.warnings:
            custom["warnings"] = "\n".join(self.warnings)
        self.bag.close()
