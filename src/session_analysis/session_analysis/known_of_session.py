"""Model and rig for estimates that are made anew: given ones, else those of the recording."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ankle_interfaces.topics import IMPEDANCE_MODEL
from ankle_physics.errors import ModelError
from ankle_physics.model import Model
from ankle_physics.rig_file import RigFile
from impedance_estimator.known_physics import KnownPhysics
from session_analysis.errors import AnalysisError
from session_analysis.estimate_origin import (
    CALIBRATION_KEYS,
    Origin,
    recorded_origins,
    recorded_texts,
    title_and_sum,
)
from session_recorder.bag_reader import BagReader
from session_recorder.rig_of_bag import rig_of_bag

LARGEST_MODEL_FILE = 1_000_000
"""[bytes] Larger files beside a bag are not read in search of its model; one of a hundred terms has
some ten thousand."""


@dataclass(frozen=True)
class GivenPhysics:
    """Holds what the caller says about the model and the rig of one session.

    Attributes
    ----------
    model
        The subject's model; None takes the one that was in force, where the bag carries it or its
        file is beside the bag.
    rig
        The rig file; None takes the one that the bag carries.
    without_rig
        Leaves out the rig file that the bag carries.
    """

    model: Model | None = None
    rig: RigFile | None = None
    without_rig: bool = False

    @property
    def is_empty(self) -> bool:
        """Tell whether nothing is given."""
        return self.model is None and self.rig is None and not self.without_rig


NOTHING_GIVEN = GivenPhysics()


def known_of_session(
    bag: BagReader, stated: Origin | None, given: GivenPhysics = NOTHING_GIVEN
) -> KnownPhysics | None:
    """Return the physics with which the estimates of a recording are made anew.

    Parameters
    ----------
    bag
        The recording.
    stated
        What was in force when it was recorded; None where it does not state it.
    given
        What counts instead.

    Returns
    -------
    KnownPhysics or None
        None where neither a model nor a rig is at hand.

    Raises
    ------
    AnalysisError
        The rig file or the model that the bag carries cannot be read, or the model has a term that
        cannot be tracked.
    """
    model, rig = given.model, given.rig
    try:
        if model is None and stated is not None and stated.model is not None:
            model = recorded_model(bag, stated.model["sha256"])
        if rig is None and not given.without_rig:
            rig = rig_of_bag(bag)
        return None if model is None and rig is None else KnownPhysics(rig, model)
    except ModelError as error:
        raise AnalysisError(f"{bag.path}: {error}") from None


def recorded_model(bag: BagReader, sha256: str) -> Model | None:
    """Return the model with which estimates of a recording were made.

    Parameters
    ----------
    bag
        The recording. It carries the model on ``/impedance/model``, or a YAML file in it or beside
        it holds it.
    sha256
        Of the model.

    Returns
    -------
    Model or None
        None where it is nowhere.

    Raises
    ------
    ModelError
        The bag carries a model with terms that are not known here.
    """
    unread: ModelError | None = None
    for text in dict.fromkeys(text for _, text in recorded_texts(bag, IMPEDANCE_MODEL) if text):
        try:
            model = Model.from_text(text)
        except ModelError as error:
            unread = error
            continue
        if model.sha256 == sha256:
            return model
    beside = _model_beside(bag.path, sha256)
    if beside is None and unread is not None:
        raise ModelError(f"the model that the bag carries: {unread}")
    return beside


def model_in_force(bag: BagReader) -> tuple[Model | None, str]:
    """Return the model with which the last estimates of a recording were made, and a sentence.

    Parameters
    ----------
    bag
        The recording.

    Returns
    -------
    tuple[Model | None, str]
        None where they were made without one, or it is nowhere, which the sentence then says. Else
        the sentence says that this model is taken.

    Raises
    ------
    AnalysisError
        The bag does not say in any known form what its estimates were made with.
    ModelError
        The bag carries a model with terms that are not known here.
    """
    origins = recorded_origins(bag.path)
    stated = origins[-1].model if origins else None
    if stated is None:
        return None, ""
    model = recorded_model(bag, stated["sha256"])
    if model is None:
        return None, (
            f"the recorded estimates were made with the model {title_and_sum(stated)}, which is "
            "neither in the bag nor beside it; give its file with --model"
        )
    return model, (
        f"the model {title_and_sum(stated)}, which was in force when the recording ended, is taken "
        "as known"
    )


def _model_beside(bag: Path, sha256: str) -> Model | None:
    """Return the model with this SHA-256 from a YAML file in a bag or beside it."""
    for file in _files_beside(bag):
        try:
            if file.stat().st_size > LARGEST_MODEL_FILE:
                continue
            model = Model.load(file)
        except (OSError, ValueError):  # another kind of file
            continue
        if model.sha256 == sha256:
            return model
    return None


def _files_beside(bag: Path) -> list[Path]:
    path = bag.resolve()
    folders = [path, path.parent] if path.is_dir() else [path.parent]
    return [file for folder in folders for file in sorted(folder.glob("*.y*ml")) if file.is_file()]


def differences(stated: Origin, used: Origin, bag: BagReader, given: GivenPhysics) -> list[str]:
    """Return in what estimates that are made anew differ from the recorded ones, one sentence each.

    Parameters
    ----------
    stated
        What was in force when the bag was recorded.
    used
        What the estimates are made with now.
    bag
        The recording.
    given
        What the caller asked for.
    """
    out = []
    if used.algorithm != stated.algorithm:
        out.append(
            f"estimates are made anew by the estimator {used.algorithm}; {stated.algorithm} made "
            "the recorded ones"
        )
    elif used.settings != stated.settings:
        out.append(
            f"estimates are made anew with the settings {used.shown('settings')}; those of the "
            f"recorded ones are {stated.shown('settings')}"
        )
    why = {
        "model": "neither the bag nor a YAML file in it or beside it holds that model; give it "
        "with --model",
        "rig": "as asked"
        if given.without_rig
        else "the bag carries no rig file; give it with --rig",
    }
    source = {
        "model": "which was in force in the end" if given.model is None else "as given",
        "rig": "which the bag carries" if given.rig is None else "as given",
    }
    for key in CALIBRATION_KEYS:
        now, then = getattr(used, key), getattr(stated, key)
        if now is None and then is not None:
            out.append(
                f"estimates are made anew without the {key} {title_and_sum(then)} that was in "
                f"force: {why[key]}"
            )
        elif now is not None and (then is None or now["sha256"] != then["sha256"]):
            out.append(
                f"estimates are made anew with the {key} {title_and_sum(now)}, {source[key]}; in "
                f"force was {title_and_sum(then)}"
            )
    return out
