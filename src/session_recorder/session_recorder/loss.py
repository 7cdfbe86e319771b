"""The account of loss: which samples and messages a recording lacks, where and since when.

The recorder keeps it while it writes, and `account_of_bag` makes it again from a bag, with the same
numbers. Every report takes its sentences about loss from here.

Samples are counted by their own time (`SampleAccount`), other messages by their publisher's numbers
(`MessageNumbers`).
"""

from __future__ import annotations

from collections.abc import Callable

from ankle_interfaces.block import MESSAGE_TYPE, TIME_COLUMN, unpack
from ankle_interfaces.errors import BlockError
from ankle_interfaces.topics import ANKLE_SAMPLES, EMG_SAMPLES
from session_recorder.bag_reader import BagReader
from session_recorder.sample_account import SampleAccount

MIN_SAMPLED_BLOCK = 4
"""Least number of samples of a sampled block. A smaller one is an event or a result (an onset, an
estimate), which has no sampling rate to keep."""
MAX_END_SPREAD = 2.0
"""[s] The nodes of a graph stop within this time. A measured signal that ends earlier than the
others was interrupted."""
MEASURED_TOPICS = (ANKLE_SAMPLES.absolute, EMG_SAMPLES.absolute)
"""Ends of the names of the topics that a measurement cannot do without."""
LOST_MESSAGES_KEY = "lost_messages "
"""Start of the keys in a bag's custom data that state lost messages, followed by the topic."""

Progress = Callable[[float], None]


class LossAccount:
    """Counts what a recording lacks, over all its topics.

    Attributes
    ----------
    topics
        The account of each sampled topic.
    lost_messages
        Messages of other topics that were lost on the way to the recorder, by topic.
    problems
        What is wrong with the bag itself, as after a killed recorder, one sentence each.
    """

    def __init__(self) -> None:
        self.topics: dict[str, SampleAccount] = {}
        self.lost_messages: dict[str, int] = {}
        self.problems: list[str] = []
        self._last_log: dict[str, int] = {}

    def add(self, topic: str, message: bytes, log_time_ns: int) -> list[str]:
        """Count a message of a topic of blocks.

        Parameters
        ----------
        topic
            Absolute name of the topic.
        message
            The message as CDR bytes.
        log_time_ns
            When it was recorded [ns].

        Returns
        -------
        list[str]
            A sentence for each thing that is wrong with it; mostly empty.
        """
        try:
            block = unpack(message)
        except BlockError as error:
            return [str(error)] if topic in self.topics else []
        if len(block.data) < MIN_SAMPLED_BLOCK or block.columns[0] != TIME_COLUMN:
            return []
        self._last_log[topic] = log_time_ns
        return self.topics.setdefault(topic, SampleAccount()).add(block)

    @property
    def missing(self) -> int:
        """Return the number of samples that are missing in all topics."""
        return sum(account.missing for account in self.topics.values())

    @property
    def missing_messages(self) -> int:
        """Return the number of lost messages of other topics."""
        return sum(self.lost_messages.values())

    @property
    def origin(self) -> float:
        """Return the time [s] of the first sample of all topics, from which sentences count."""
        return min(
            (account.first for account in self.topics.values() if account.first is not None),
            default=0.0,
        )

    def sentences(self) -> list[str]:
        """Return what is lost, with number, topic and place; empty for a whole recording.

        Places are seconds after the recording's first sample. Estimates that are NaN because they
        are not valid are no loss.
        """
        found = list(self.problems)
        for topic, account in self.topics.items():
            found += [
                sentence
                for sentence in account.sentences(topic, self.origin)
                if "impedance/" not in topic or "NaN" not in sentence
            ]
        found += self._early_ends()
        found += [
            f"{topic}: {count} message(s) were lost on the way to the recorder"
            for topic, count in self.lost_messages.items()
            if count
        ]
        return found

    def _early_ends(self) -> list[str]:
        if not self._last_log:
            return []
        end = max(self._last_log.values())
        return [
            f"{topic}: ends {(end - log) * 1e-9:.1f} s before the recording's last sample"
            for topic, log in self._last_log.items()
            if topic.endswith(MEASURED_TOPICS) and (end - log) * 1e-9 > MAX_END_SPREAD
        ]

    def figures(self) -> dict[str, dict[str, float]]:
        """Return counts by topic, for tables and JSON."""
        return {
            topic: {
                "samples": account.samples,
                "missing": account.missing,
                "gaps": len(account.lasting_gaps),
                "late": account.late,
                "repeated": account.repeated,
                "rate[Hz]": account.rate or float("nan"),
            }
            for topic, account in self.topics.items()
        }


def account_of_bag(bag: BagReader, progress: Progress | None = None) -> LossAccount:
    """Count what a bag lacks.

    Parameters
    ----------
    bag
        An open bag; a damaged one too. Damaged chunks become problems.
    progress
        Called with the fraction that is read.

    Returns
    -------
    LossAccount
        The numbers that the recorder had at its end.
    """
    account = LossAccount()
    sampled = {name for name, topic in bag.topics.items() if topic.type == MESSAGE_TYPE}
    total = max(1, sum(bag.topics[name].count for name in sampled))
    for done, (topic, log_time, _, message) in enumerate(bag.readable_messages(sampled)):
        account.add(topic, message, log_time)
        if progress and done % 1000 == 0:
            progress(done / total)
    account.problems = list(dict.fromkeys(bag.problems))
    for key, value in bag.custom_data.items():
        if key.startswith(LOST_MESSAGES_KEY) and value.isdigit():
            account.lost_messages[key.removeprefix(LOST_MESSAGES_KEY)] = int(value)
    return account
