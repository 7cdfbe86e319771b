"""`ankle emg`: muscle activity from a bag."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ankle_bringup.terminal import Out, Overwrite, console, new_table, progress

NOTES_SHOWN = 10  # a bad electrode gives one for every onset


def verb(
    bag: Annotated[
        Path,
        typer.Argument(help="A bag with emg/samples and perturbation/reference or ankle/samples."),
    ],
    out: Out = Path("emg_responses"),
    overwrite: Overwrite = False,
) -> dict[str, Any]:
    """Compute background and reflex activity of every onset in a bag, as the node does.

    Writes a bag with /emg/responses and /emg/ensemble.

    Example: ankle emg session --out session_responses
    """
    from emg_driver.offline import respond_bag, summary

    with progress(f"reading {bag}") as share:
        found = respond_bag(bag, out, overwrite=overwrite, progress=share)
    for note in found.notes[:NOTES_SHOWN]:
        console.print(f"note: {note}")
    columns = ("muscle", "onsets", "background [uV]", "reflex [uV.s]")
    table = new_table(columns)
    rows = [dict(zip(columns, row, strict=True)) for row in summary(found)]
    for row in rows:
        table.add_row(*row.values())
    console.print(table)
    console.print(f"{len(found.rows)} onsets; written to {out.resolve()}")
    return {"out": out.resolve(), "onsets": len(found.rows), "muscles": rows, "notes": found.notes}
