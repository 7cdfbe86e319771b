"""Files that hold several tables, below one another or on sheets: which of them are read."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence

from session_recorder.errors import ImportRefused
from session_recorder.importing.column_names import MUSCLES, quantity_of
from session_recorder.importing.joined_sections import joined, why_not_joined
from session_recorder.importing.table import Table

MIN_RECORDED_ROWS = 100
"""Rows of a table that can be a recording, two seconds at the lowest rate; a table of results has
fewer."""
_SHOWN_COLUMNS = 6


def choose_section(tables: list[Table], asked: Sequence[str], wanted: Collection[str]) -> Table:
    """Return the table of a file that holds the recording, or the tables that do as one.

    Parameters
    ----------
    tables
        Tables of one file, at least one, in its order.
    asked
        Titles of tables or their numbers, counted from 1; empty where nobody chose. Several are
        joined.
    wanted
        Columns that the table has to hold; empty where they are not known yet.

    Returns
    -------
    Table
        With what was read in `Table.sections` where the file holds several tables, and a note
        that names the others. Where nobody chose, tables of one trial that complete each other, as
        torque and EMG do, are joined.

    Raises
    ------
    ImportRefused
        No table is the one asked for, several can be meant, or those asked for cannot be joined;
        the message says what to type.
    """
    _name(tables)
    if asked:
        named = list(
            {id(table): table for table in (_asked_for(tables, a) for a in asked)}.values()
        )
        return _whole(named) if len(tables) > 1 else tables[0]
    if len(tables) == 1:
        tables[0].section = ""
        return tables[0]
    long = [table for table in tables if _rows(table) >= MIN_RECORDED_ROWS] or tables
    holding = [table for table in long if wanted and set(wanted) <= set(table.names)]
    best = _best(holding or long)
    chosen = best[0]
    adding = [] if holding else [table for table in long if _completes(table, chosen)]
    if rivals := [table for table in best[1:] if table not in adding]:
        raise ImportRefused(_several(chosen, [chosen, *rivals]))
    notes = []
    joining: list[Table] = []
    for table in adding:
        alike = [other for other in adding if _quantities(other) & _quantities(table)]
        reason = why_not_joined(chosen, table)
        if len(alike) > 1:
            reason = "other tables have " + ", ".join(sorted(_quantities(table))) + " as well"
        if reason:
            line = f"--section '{chosen.section}' --section '{table.section}'"
            notes.append(f"'{table.section}' is left out: {reason}. {line} would join it")
        else:
            joining.append(table)
    made = _whole([chosen, *joining])
    made.notes.insert(0, _told([chosen, *joining], tables))
    made.notes[1:1] = notes
    return made


def _best(tables: list[Table]) -> list[Table]:
    """Return the tables that hold most of a recording; without signals those of most rows."""
    ranks = [_rank(table) for table in tables]
    best = [table for table, rank in zip(tables, ranks, strict=True) if rank == max(ranks)]
    if any(max(ranks)):
        return best
    most = max(_rows(table) for table in best)
    return [table for table in best if _rows(table) == most]


def _completes(table: Table, chosen: Table) -> bool:
    """Return whether a table has signals that the chosen one lacks, and none of the same name, as
    that of another trial has.
    """
    if table is chosen or not _quantities(table) - _quantities(chosen):
        return False
    return not _signals(table) & _signals(chosen)


def _signals(table: Table) -> set[str]:
    return {n for n in table.columns if quantity_of(n, table.units.get(n)) not in (None, "t")}


def _whole(tables: list[Table]) -> Table:
    """Return one table of several, or the only one."""
    if len(tables) > 1:
        return joined(tables)
    tables[0].sections = (tables[0].section,)
    return tables[0]


def _several(chosen: Table, tables: list[Table]) -> str:
    held = "; ".join(f"'{table.section}': {_contents(table)}" for table in tables)
    return (
        f"{chosen.source} holds {len(tables)} tables that can be meant: {held}. Choose one, as "
        f"in: ankle import {chosen.source} --section '{chosen.section}'"
    )


def _told(chosen: list[Table], tables: list[Table]) -> str:
    """Return which tables of a file are read, why, and which are not."""
    quantities = ", ".join(sorted(set().union(*map(_quantities, chosen)))) or "most rows"
    others = [f"'{t.section}' ({_rows(t)} rows)" for t in tables if t not in chosen]
    titles = " and ".join(f"'{table.section}'" for table in chosen)
    verb = (
        f"are joined, because together they have {quantities}"
        if len(chosen) > 1
        else f"is read, because it has {quantities}"
    )
    left = f"; not {', '.join(others)}, which --section would choose" if others else ""
    return f"the file holds {len(tables)} tables; {titles} {verb}{left}"


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
