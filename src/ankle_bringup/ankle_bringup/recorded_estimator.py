"""The estimator of a replay is set as in the recorded run: its estimates come out the same."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ankle_bringup.graph import Graph, NodeDescription

if TYPE_CHECKING:
    from session_analysis.estimate_origin import Origin

REPLAY = ("session_recorder", "replay")
ESTIMATOR = ("impedance_estimator", "impedance_estimator")
RECORDER = ("session_recorder", "record")
RIG_FILE = "recorded_rig.yaml"
"""Name of the file that gets the rig which the bag carries."""
MODEL_FILE = "recorded_model.yaml"
"""Name of the file that gets the model which the bag carries."""


def set_as_recorded(graph: Graph, folder: Path) -> tuple[Graph, list[str]]:
    """Return the graph with the estimator of the recording that it replays.

    What is set already stays. A graph that replays nothing, or a bag without estimates, is returned
    as it is.

    Parameters
    ----------
    graph
        Any graph.
    folder
        Gets the rig file and the model that the bag carries.

    Returns
    -------
    tuple[Graph, list[str]]
        The graph; and sentences: what was set, and what the bag does not hold.

    Raises
    ------
    session_recorder.errors.BagError
        No such bag.
    AnalysisError
        The bag says in no known form what its estimates were made with.
    """
    from session_analysis.estimate_origin import recorded_origins

    bags = [str(node.parameters.get("bag") or "") for node in _named(graph, REPLAY)]
    estimators = _named(graph, ESTIMATOR)
    if len(bags) != 1 or not bags[0] or len(estimators) != 1:
        return graph, []
    origins = recorded_origins(Path(bags[0]))
    if not origins:
        return graph, []
    (estimator,), origin = estimators, origins[-1]
    if estimator.parameters.get("algorithm", origin.algorithm) != origin.algorithm:
        return graph, []
    recorded = {"algorithm": origin.algorithm, **dict(origin.settings)}
    said = [f"the estimator is set as in the recorded run ({origin.algorithm})"]
    rig, lacking_rig = _rig(Path(bags[0]), origin, folder, estimator)
    model, lacking_model = _model(Path(bags[0]), origin, folder, estimator)
    recorded |= {"rig": rig} if rig else {}
    recorded |= {"model": model} if model else {}
    said += [lacking for lacking in (lacking_rig, lacking_model) if lacking]
    if any(one.difference(origin) for one in origins):
        said.append("it was changed in the recorded run: it has what it had in the end")
    changed = {estimator.name: {**recorded, **estimator.parameters}}
    if rig:
        changed |= {n.name: {"rig": rig, **n.parameters} for n in _named(graph, RECORDER)}
    nodes = [replace(n, parameters=changed.get(n.name, n.parameters)) for n in graph.nodes]
    return replace(graph, nodes=tuple(nodes)), said


def _named(graph: Graph, executable: tuple[str, str]) -> list[NodeDescription]:
    return [node for node in graph.nodes if (node.package, node.executable) == executable]


def _rig(bag: Path, origin: Origin, folder: Path, estimator: NodeDescription) -> tuple[str, str]:
    """Return the path of the rig file that was in force, empty where it is not needed or not there;
    and a sentence where it is lacking.
    """
    from session_recorder.rig_of_bag import rig_of_bags

    if origin.rig is None or "rig" in estimator.parameters:
        return "", ""
    carried = rig_of_bags([bag])
    text = carried.text() if carried is not None else ""
    if hashlib.sha256(text.encode()).hexdigest() != origin.rig["sha256"]:
        return "", (
            f"its rig '{origin.rig['title']}' is not in the bag: name the file by --set "
            f"{estimator.name}.rig=FILE"
        )
    return _kept(folder / RIG_FILE, text), ""


def _model(bag: Path, origin: Origin, folder: Path, estimator: NodeDescription) -> tuple[str, str]:
    """Return the same of the subject's model."""
    from ankle_physics.errors import ModelError
    from session_analysis.estimate_origin import title_and_sum
    from session_analysis.known_of_session import recorded_model
    from session_recorder.bag_reader import BagReader

    if origin.model is None or "model" in estimator.parameters:
        return "", ""
    try:
        model = recorded_model(BagReader(bag), origin.model["sha256"])
        lacks = "is neither in the bag nor beside it"
    except ModelError as error:
        model, lacks = None, f"has terms that are not known here ({error})"
    if model is None:
        return "", (
            f"its model {title_and_sum(origin.model)} {lacks}: name the file by --set "
            f"{estimator.name}.model=FILE"
        )
    return _kept(folder / MODEL_FILE, model.text()), ""


def _kept(path: Path, text: str) -> str:
    """Write a file that the estimator reads, and return its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return str(path.resolve())
