"""A bag carries the rig file that was in force when it was recorded or imported.

Rig files are loaded where one is read: a recorder without one would wait a second for the compiler
behind them.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ankle_interfaces.errors import QuantityError
from ankle_physics.errors import ModelError
from session_recorder.bag_reader import BagReader
from session_recorder.errors import BagError

if TYPE_CHECKING:
    from ankle_physics.rig_file import RigFile

RIG_KEY = "rig"
"""Key of the rig file's text among the bag's own pairs (``custom_data`` of ``metadata.yaml``)."""


def rig_of_bag(bag: BagReader) -> RigFile | None:
    """Return the rig file that a bag carries; None where it carries none.

    Raises
    ------
    ankle_physics.errors.ModelError
        What it carries is no rig file.
    """
    from ankle_physics.rig_file import RigFile

    text = bag.custom_data.get(RIG_KEY)
    return RigFile.from_text(text) if text else None


def rig_text(path: str) -> str:
    """Return the text of a rig file.

    Raises
    ------
    QuantityError
        It cannot be read, or is no rig file.
    """
    from ankle_physics.rig_file import RigFile

    try:
        return RigFile.load(path).text()
    except (ModelError, OSError) as error:
        raise QuantityError(f"parameter 'rig': {error}") from None


def rig_of_bags(bags: Sequence[Path | str]) -> RigFile | None:
    """Return the rig file that recordings of one rig carry; None where none of them carries one.

    Parameters
    ----------
    bags
        Bags that are read together.

    Raises
    ------
    BagError
        No such bag, or they carry different rig files, or only some of them one.
    ankle_physics.errors.ModelError
        What they carry is no rig file.
    """
    carried = {path: rig_of_bag(BagReader(path)) for path in bags}
    texts = {rig.text() if rig is not None else "" for rig in carried.values()}
    if len(texts) > 1:
        listed = ", ".join(
            f"{path}: {rig.title if rig else 'none'}" for path, rig in carried.items()
        )
        raise BagError(f"the bags carry different rig files ({listed}); name one with --rig")
    return next(iter(carried.values()), None)
