"""`ankle fetch-trials`: real human ankles."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ankle_bringup.terminal import console, progress


def verb(
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder for the bags; the user's cache unless given."),
    ] = None,
    url: Annotated[
        str, typer.Option(help="Another place that has the file, such as your own mirror.")
    ] = "",
    sha256: Annotated[str, typer.Option(help="Checksum of that file.")] = "",
) -> dict[str, Any]:
    """Fetch public recordings of a human ankle (2 MB, McGill University) and import them as bags.

    Each trial is 60 s of small random steps at 1000 Hz, with true reflexes. The file is fetched
    once and its checksum is verified. `ankle demo` uses the trials when they are there.

    Example: ankle fetch-trials
    """
    from ankle_bringup.human_trials import MCGILL, Recording, cache_folder, fetch, import_trials

    wanted = Recording(url or MCGILL.url, sha256 or MCGILL.sha256, MCGILL.name)
    folder = out or cache_folder() / "human_trials"
    file = fetch(wanted, folder.parent if out is None else folder, not console.quiet)
    with progress("importing") as share:
        bags = import_trials(file, folder, share)
    for bag in bags:
        console.print(str(bag))
    if bags:
        console.print(f"next: ankle estimate {bags[0]}, or: ankle diagnose {bags[0]}")
    return {"file": file, "bags": bags}
