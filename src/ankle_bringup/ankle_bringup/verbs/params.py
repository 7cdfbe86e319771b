"""`ankle params`: the parameters of a running node."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from ankle_bringup.terminal import console, new_table


def verb(
    node: Annotated[str, typer.Argument(help="Name of a running node.")],
    parameter: Annotated[str | None, typer.Argument(help="Show this one only.")] = None,
    value: Annotated[str | None, typer.Argument(help="Set it to this value.")] = None,
) -> list[dict[str, Any]]:
    """Show the parameters of a running node with unit, range and description, or set one.

    Example: ankle params ankle_sim K 120.0
    """
    from ankle_bringup.live_graph import describe_parameters, observer, set_parameter
    from ankle_bringup.suggestion import require_known

    columns = ("parameter", "value", "what it is", "allowed")
    with observer() as looking:
        found = {d.name: (d, present) for d, present in describe_parameters(looking, node)}
        if parameter is not None:
            require_known(f"parameter of {node}", parameter, found)
            found = {parameter: found[parameter]}
        if parameter is not None and value is not None:
            set_parameter(looking, node, parameter, value)
            console.print(f"{node}: {parameter} = {value}")
            return [{"parameter": parameter, "value": value}]
    table = new_table(columns)
    rows = []
    for name, (descriptor, present) in found.items():
        row = (name, present, descriptor.description, descriptor.additional_constraints)
        table.add_row(*map(str, row))
        rows.append(dict(zip(columns, row, strict=True)))
    console.print(table)
    return rows
