"""Files that hold several tables, below one another or on sheets: which of them is read."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection

from session_recorder.errors import ImportRefused
from session_recorder.importing.column_names import MUSCLES, quantity_of
from session_recorder.importing.table import Table

MIN_RECORDED_ROWS = 100
"""Rows of a table that can be a recording, two seconds at the lowest rate; a table of results has
fewer."""
_SHOWN_COLUMNS = 6


def choose_section(tables: list[Table], asked: str | None, wanted: Collection[str]) -> Table:
    """Return the table of a file that holds the recording.

    Parameters
    ----------
    tables
        Tables of one file, at least one, in its order.
    asked
        Title of a table or its number, counted from 1; None where nobody chose.
    wanted
        Columns that the table has to hold; empty where they are not known yet.

    Returns
    -------
    Table
        With its title or number in `Table.section` where the file holds several tables, and a note
        that names the others.

    Raises
    ------
    ImportRefused
        No table is the one asked for, or several can be meant; the message says what to type.
    """
    _name(tables)
    if asked is not None:
        return _asked_for(tables, asked)
    if len(tables) == 1:
        tables[0].section = ""
        return tables[0]
    long = [table for table in tables if _rows(table) >= MIN_RECORDED_ROWS] or tables
    fitting = [table for table in long if wanted and set(wanted) <= set(table.names)] or long
    ranks = [_rank(table) for table in fitting]
    best = [table for table, rank in zip(fitting, ranks, strict=True) if rank == max(ranks)]
    if not any(max(ranks)):
        most = max(_rows(table) for table in best)
        best = [table for table in best if _rows(table) == most]
    if len(best) > 1:
        held = "; ".join(f"'{table.section}': {_contents(table)}" for table in best)
        raise ImportRefused(
            f"{best[0].source} holds {len(best)} tables that can be meant: {held}. Choose one, as "
            f"in: ankle import {best[0].source} --section '{best[0].section}'"
        )
    chosen = best[0]
    others = ", ".join(f"'{t.section}' ({_rows(t)} rows)" for t in tables if t is not chosen)
    quantities = ", ".join(sorted(_quantities(chosen))) or "most rows"
    chosen.notes.append(
        f"the file holds {len(tables)} tables; '{chosen.section}' is read, because it has "
        f"{quantities}; not {others}, which --section would choose"
    )
    return chosen


def _name(tables: list[Table]) -> None:
    """Give each table of several a name of its own: its title, or its number in the file."""
    if len(tables) < 2:
        return
    count = Counter(table.section.lower() for table in tables)
    for number, table in enumerate(tables, 1):
        if not table.section or count[table.section.lower()] > 1 or table.section.isdigit():
            table.section = str(number)


def _asked_for(tables: list[Table], asked: str) -> Table:
    for table in tables:
        if table.section.lower() == asked.strip().lower():
            return table
    if asked.isdigit() and 1 <= int(asked) <= len(tables):
        return tables[int(asked) - 1]
    held = "; ".join(
        f"{number} '{table.section}': {_contents(table)}" for number, table in enumerate(tables, 1)
    )
    raise ImportRefused(f"{tables[0].source} has no table '{asked}'; it holds {held}")


def _rank(table: Table) -> tuple[int, int]:
    """Return how much of a recording a table holds: of mechanics first, then of EMG."""
    held = _quantities(table)
    return len(held & {"position", "torque"}), len(held & set(MUSCLES))


def _quantities(table: Table) -> set[str]:
    found = {quantity_of(name, table.units.get(name)) for name in table.columns}
    return {quantity for quantity in found if quantity in {"position", "torque", *MUSCLES}}


def _rows(table: Table) -> int:
    return max((len(values) for values in table.columns.values()), default=0)


def _contents(table: Table) -> str:
    names = table.names
    shown = ", ".join(names[:_SHOWN_COLUMNS]) + (", ..." if len(names) > _SHOWN_COLUMNS else "")
    return f"{_rows(table)} rows of {shown}"
