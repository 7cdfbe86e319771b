"""The subject's model that a verb takes as known: a file, or the one that a bag carries."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ankle_physics.model import Model

NO_MODEL = Path("none")
"""Given as ``--model``, it leaves out the model with which the recorded estimates were made."""
KnownModel = Annotated[
    Path | None,
    typer.Option(
        "--model",
        help="The subject's model (YAML), whose terms run beside the regression; else the one "
        "with which the bag's last estimates were made. 'none' leaves that one out.",
    ),
]


def known_model(given: Path | None, bag: Path) -> tuple[Model | None, str]:
    """Return the subject's model that is taken as known, and a sentence about that of the bag.

    Parameters
    ----------
    given
        The file, or `NO_MODEL`; None takes what the bag carries.
    bag
        A recording.

    Raises
    ------
    ankle_physics.errors.ModelError
        The file, or what the bag carries, is no model file, or has terms that are not known.
    OSError
        The file cannot be read.
    session_recorder.errors.BagError
        No such bag.
    session_analysis.errors.AnalysisError
        The bag says in no known form what its estimates were made with.
    """
    from ankle_physics.errors import ModelError
    from ankle_physics.model import Model
    from session_analysis.known_of_session import model_in_force
    from session_recorder.bag_reader import BagReader

    if given is not None:
        return (None if given == NO_MODEL else Model.load(given)), ""
    try:
        model, about = model_in_force(BagReader(bag))
    except ModelError as error:
        raise ModelError(
            f"{bag}: {error}; name the folder of its terms with --terms, or leave the model out "
            "with --model none"
        ) from None
    return model, f"{about}; --model none leaves it out" if model is not None else about
