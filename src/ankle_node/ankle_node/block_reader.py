"""What a reader of a block topic does with each message, without ROS."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum

from ankle_interfaces.block import Block, select_columns, unpack
from ankle_interfaces.continuity import Continuity, Finding
from ankle_interfaces.errors import BlockError


class Defect(Enum):
    """Names what is wrong, as ``/diagnostics`` has it behind the topic's name."""

    BLOCK = "blocks"
    UNIT = "units"
    STREAM = ""


class BlockReader:
    """Unpacks the messages of one topic, and hands on the columns that a reader wants.

    Parameters
    ----------
    topic
        Full name of the topic, for messages.
    wanted, optional
        SI names of the columns, without time; those of `optional` may be missing.
    callback
        Called with each block and what is wrong in the stream.
    report
        Called with each defect, a sentence, and whether the sentence is new; findings in the
        stream always are.
    sparse
        Whether NaN stands for a value that does not exist, and is not reported.

    Attributes
    ----------
    continuity
        What is known of the stream: its rate, its missing samples.
    """

    def __init__(
        self,
        topic: str,
        wanted: Sequence[str],
        optional: Sequence[str],
        callback: Callable[[Block, list[Finding]], None],
        report: Callable[[Defect, str, bool], None],
        sparse: bool = False,
    ) -> None:
        self._topic, self._wanted, self._optional = topic, wanted, optional
        self._callback, self._report = callback, report
        self._reported: set[str] = set()
        self.continuity = Continuity(sparse=sparse)

    def take(self, message: bytes) -> None:
        """Process a message in its serialised form; one that is no such block is dropped."""
        try:
            block, notes = select_columns(
                unpack(message), self._wanted, self._topic, self._optional
            )
        except BlockError as error:
            text = str(error)
            named = text if text.startswith(self._topic) else f"{self._topic}: {text}"
            self._tell(Defect.BLOCK, named)
            return
        for note in notes:
            self._tell(Defect.UNIT, f"{self._topic}: {note}")
        findings = self.continuity.check(block.data)
        for finding in findings:
            self._report(Defect.STREAM, finding.message, True)
        self._callback(block, findings)

    def _tell(self, defect: Defect, sentence: str) -> None:
        first = sentence not in self._reported
        self._reported.add(sentence)
        self._report(defect, sentence, first)
