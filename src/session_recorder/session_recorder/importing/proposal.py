"""A mapping of an unknown file's columns that is likely, with its reasons and doubts."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field
from pathlib import Path

from session_recorder.importing.statement import PROJECT_DIRECTION


@dataclass
class Proposal:
    """Holds a mapping that is likely, and why.

    Attributes
    ----------
    columns
        Stated name with unit -> column of the file, as `import_recording` takes it.
    rate
        Sampling rate [Hz] to state; None where the time column gives it.
    torque_sign
        ``rig`` or ``subject``; None without torque.
    resample
        Rate [Hz] of an even grid; None where the sampling is regular.
    neutral, positive
        Angle of the neutral ankle in the file's unit, and the direction in which it rises.
    sections
        Tables of the file that are read, where it holds several; else empty.
    reasons
        One sentence for each part.
    doubts
        What is a guess or could not be settled, one sentence each.
    """

    columns: dict[str, str] = field(default_factory=dict)
    rate: float | None = None
    torque_sign: str | None = None
    resample: float | None = None
    neutral: float = 0.0
    positive: str = PROJECT_DIRECTION
    sections: tuple[str, ...] = ()
    reasons: list[str] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)

    def command(self, source: Path | str, out: Path | str) -> str:
        """Return the command line to type."""
        parts = ["ankle", "import", str(source), "--out", str(out)]
        for section in self.sections:
            parts += ["--section", section]
        for name, column in self.columns.items():
            parts += ["--column", f"{name}={column}"]
        if self.torque_sign:
            parts += ["--torque-sign", self.torque_sign]
        if self.rate:
            parts += ["--rate", f"{self.rate:.10g}"]
        if self.resample:
            parts += ["--resample", f"{self.resample:.10g}"]
        if self.neutral:
            parts += ["--neutral", f"{self.neutral:.10g}"]
        if self.positive != PROJECT_DIRECTION:
            parts += ["--positive", self.positive]
        return shlex.join(parts)
