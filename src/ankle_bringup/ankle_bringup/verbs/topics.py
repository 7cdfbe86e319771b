"""`ankle topics`: what travels in the running graph."""

from __future__ import annotations

from typing import Any

from ankle_bringup.terminal import console, new_table


def verb() -> list[dict[str, Any]]:
    """List the topics of the running graph, with their types and how many publish and read them.

    Example: ankle topics
    """
    from ankle_bringup.live_graph import observer, topics

    columns = ("topic", "type", "publishers", "readers")
    with observer() as node:
        rows = [dict(zip(columns, row, strict=True)) for row in topics(node)]
    table = new_table(columns)
    for row in rows:
        table.add_row(*map(str, row.values()))
    console.print(table)
    return rows
