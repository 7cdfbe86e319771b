"""The values of a study's visits, and which of them tell how well a measure repeats."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ankle_interfaces.value_text import with_unit
from session_analysis.study.layout import recording_name
from session_analysis.study.recording_results import Row

DOUBT_LIMIT = 0.5
"""Share of doubtful estimates from which a recording is called doubtful: its value is the median of
its estimates, and from a half on the median may itself be a doubtful one."""
LEG_MARK = ", "
"""Stands between subject and leg where both legs of a subject were measured; no pseudonym holds
it."""


def is_doubtful(row: Row) -> bool:
    """Tell whether a value comes from a recording most of whose estimates are doubtful."""
    return row.doubt >= DOUBT_LIMIT


def subject_of(name: str) -> str:
    """Return the subject of a name that may also tell the leg."""
    return name.partition(LEG_MARK)[0]


def recording_of(row: Row) -> str:
    """Return the name of the recording that a row comes from."""
    return recording_name(subject_of(row.subject), row.visit, row.run)


def visit_table(
    rows: Sequence[Row], quantity: str, without_doubt: bool = False
) -> tuple[list[str], list[int], np.ndarray]:
    """Return the means over the runs of each visit.

    Parameters
    ----------
    rows
        Of the table of results.
    quantity
        Name with its unit.
    without_doubt
        Leave out recordings that are doubtful, see `is_doubtful`. Subjects and visits stay the
        same.

    Returns
    -------
    tuple[list[str], list[int], np.ndarray]
        Subjects, visits, and values of shape (subjects, visits), NaN where there is none.
    """
    chosen = [row for row in rows if row.quantity == quantity and np.isfinite(row.value)]
    subjects = sorted({row.subject for row in chosen})
    visits = sorted({row.visit for row in chosen})
    values = np.full((len(subjects), len(visits)), np.nan)
    used = [row for row in chosen if not (without_doubt and is_doubtful(row))]
    for i, subject in enumerate(subjects):
        for k, visit in enumerate(visits):
            own = [row.value for row in used if (row.subject, row.visit) == (subject, visit)]
            if own:
                values[i, k] = float(np.mean(own))
    return subjects, visits, values


def doubtful_recordings(rows: Sequence[Row], quantities: Sequence[str]) -> list[str]:
    """Return the names of the recordings whose values of these quantities are doubtful."""
    return sorted({recording_of(row) for row in rows if row.quantity in quantities
                   and is_doubtful(row)})  # fmt: skip


def left_out_sentence(rows: Sequence[Row], quantities: Sequence[str], subject: str = "") -> str:
    """Return how many recordings a comparison leaves out because of doubt, and which.

    Parameters
    ----------
    rows
        Of the table of results.
    quantities
        Those that are compared.
    subject
        Whose report this is: recordings of other subjects are then counted and not named.

    Returns
    -------
    str
        Empty where none is left out.
    """
    names = doubtful_recordings(rows, quantities)
    if not names:
        return ""
    named = [name for name in names if not subject or name.startswith(f"sub-{subject}_")]
    others = len(names) - len(named)
    which = [*named, *([f"{others} of other subjects"] if others else [])]
    return (
        f"Left out: {len(names)} recording(s) of which {100 * DOUBT_LIMIT:g} % or more of the "
        f"estimates are doubtful: {', '.join(which)}."
    )


def name_and_unit(quantity: str) -> tuple[str, str]:
    """Return a quantity's name and its unit as people read them: ``K`` and ``N·m/rad``."""
    name, _, unit = with_unit(quantity).rstrip("]").partition(" [")
    return name, unit
