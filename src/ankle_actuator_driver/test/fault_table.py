"""The table of a fault campaign: what one case gave, what all cases of a fault gave, and how many
cases kept every promise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

COLUMNS = (
    "fault",
    "promised",
    "state afterwards",
    "beyond a limit",
    "samples lost",
    "reported",
    "slowest to rest [ms]",
    "running again [s], median",
)
HEAD = f"| {' | '.join(COLUMNS)} |\n|{' --- |' * len(COLUMNS)}"
KEPT_STATES = {
    "goes on": ("running",),
    "stops": ("ready", "stopping"),
    "faults": ("fault",),
    "stops or faults": ("ready", "stopping", "fault"),
    "ends off": ("ready", "fault", "disabled"),
    "stays armed": ("armed",),
    "stays ready": ("ready",),
    "stays in fault": ("fault",),
}
"""States that keep a promise; any other promise allows every state."""


@dataclass
class Case:
    """One fault at one moment.

    Attributes
    ----------
    state
        State of the driver afterwards.
    reason
        Why it is so, in the driver's words.
    rest
        Time from the fault to the plate at rest [s]; NaN where the plate is to move on.
    again
        Time until the plate runs again [s], 0 where it never stopped, NaN where it does not run.
    lost
        Samples that are missing.
    reported
        Samples that were reported as missing.
    beyond
        Whether a limit was passed.
    problems
        What else was wrong, as sentences.
    """

    state: str
    reason: str = ""
    rest: float = np.nan
    again: float = 0.0
    lost: int = 0
    reported: int = 0
    beyond: bool = False
    problems: list[str] = field(default_factory=list)

    def broken(self, promise: str) -> list[str]:
        """Return everything by which this case breaks its promise, as sentences."""
        found = list(self.problems)
        if self.state not in KEPT_STATES.get(promise, (self.state,)):
            found.append(f"the driver was {self.state}: {self.reason}")
        if not np.isfinite(self.again):
            found.append("the plate did not run again")
        if self.beyond:
            found.append("the motion passed a limit")
        if self.lost != self.reported:
            found.append(f"{self.lost} samples were lost, {self.reported} were reported")
        return found


@dataclass
class Outcome:
    """All cases of one fault.

    Attributes
    ----------
    name, promise
        Of the fault.
    cases
        In the order in which they were made.
    """

    name: str
    promise: str
    cases: list[Case] = field(default_factory=list)

    def row(self) -> str:
        """Return the fault's row of the table."""
        states = [case.state for case in self.cases]
        counted = ", ".join(f"{state} {states.count(state)}" for state in dict.fromkeys(states))
        rest = [case.rest for case in self.cases if np.isfinite(case.rest)]
        again = [case.again for case in self.cases if np.isfinite(case.again) and case.again > 0.01]
        cells = (
            self.name,
            self.promise,
            counted,
            sum(case.beyond for case in self.cases),
            sum(case.lost for case in self.cases),
            sum(case.reported for case in self.cases),
            f"{1e3 * max(rest):.0f}" if rest else "—",
            f"{np.median(again):.2f}" if again else "0",
        )
        return f"| {' | '.join(str(cell) for cell in cells)} |"

    def broken(self) -> list[str]:
        """Return one sentence for each case that broke the promise."""
        found = [case.broken(self.promise) for case in self.cases]
        return [f"{self.name}: {'; '.join(sentences)}" for sentences in found if sentences]


def verdict(outcomes: Sequence[Outcome]) -> str:
    """Return how many of all cases kept their promises, as a sentence."""
    cases = sum(len(outcome.cases) for outcome in outcomes)
    broken = sum(len(outcome.broken()) for outcome in outcomes)
    count = f"{cases - broken} of {cases}" if broken else f"all of {cases}"
    return (
        "Cases that kept their promise, without motion beyond a limit and without unreported "
        f"loss: {count}."
    )


def write_section(page: Path, title: str, text: str) -> None:
    """Put a section of a page in the place of the one that has its title; the others stay.

    Parameters
    ----------
    page
        A file with headings of the second order.
    title
        Of the section.
    text
        Everything below its heading.
    """
    first, *sections = page.read_text().split("\n## ")
    titles = [section.partition("\n")[0] for section in sections]
    written = f"{title}\n\n{text.strip()}\n"
    if title in titles:
        sections[titles.index(title)] = written
    else:
        sections.append(written)
    page.write_text("\n\n## ".join(part.strip() for part in (first, *sections)) + "\n")
