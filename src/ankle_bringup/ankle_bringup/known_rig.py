"""The calibrated rig that a verb takes as known: a file, or the one that a bag carries."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ankle_physics.rig_file import RigFile

NO_RIG = Path("none")
"""Given as ``--rig``, it leaves out the rig file that a bag carries."""
KnownRig = Annotated[
    Path | None,
    typer.Option(
        "--rig",
        help="The calibrated rig (rig.yaml), taken as known; else the one that the bag carries. "
        "'none' leaves that one out.",
    ),
]


def known_rig(given: Path | None, bags: Sequence[Path]) -> tuple[RigFile | None, str]:
    """Return the rig that is taken as known, and a sentence where it is that of the bags.

    Parameters
    ----------
    given
        The file, or `NO_RIG`; None takes what the bags carry.
    bags
        Recordings of one rig.

    Raises
    ------
    ankle_physics.errors.ModelError
        The file, or what the bags carry, is no rig file.
    OSError
        The file cannot be read.
    session_recorder.errors.BagError
        No such bag, or the bags carry different rig files.
    """
    from ankle_physics.rig_file import RigFile
    from session_recorder.rig_of_bag import rig_of_bags

    if given is not None:
        return (None if given == NO_RIG else RigFile.load(given)), ""
    carried = rig_of_bags(bags)
    if carried is None:
        return None, ""
    return carried, (
        f"the rig '{carried.title}', calibrated {carried.calibrated:%Y-%m-%d}, which the bag "
        "carries, is taken as known; --rig none leaves it out"
    )
