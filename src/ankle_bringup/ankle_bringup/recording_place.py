"""Where the recorder of a graph writes: a place in a study, or a name that is still free."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ankle_bringup.errors import GraphError
from ankle_bringup.graph import Graph, NodeDescription

if TYPE_CHECKING:
    from session_analysis.study.layout import Entry

RECORDER = ("session_recorder", "record")
SCREENS = ("biofeedback", "biofeedback")


def _recorders(graph: Graph) -> list[NodeDescription]:
    return [node for node in graph.nodes if (node.package, node.executable) == RECORDER]


def _recording_to(graph: Graph, out: Path) -> Graph:
    nodes = tuple(
        replace(node, parameters={**node.parameters, "out": str(out)})
        if (node.package, node.executable) == RECORDER
        else node
        for node in graph.nodes
    )
    return replace(graph, nodes=nodes)


def in_study(
    graph: Graph, study: Path, subject: str, visit: int, stated: dict[str, Any] | None = None
) -> tuple[Graph, Path]:
    """Return the graph with its recorder writing to the next run of a visit.

    Parameters
    ----------
    graph
        A graph with a recorder.
    study
        Made by ``ankle study init``.
    subject
        Pseudonym of the subject.
    visit
        Number of the visit, counted from 1.
    stated
        Content of the recording's sidecar file.

    Returns
    -------
    tuple[Graph, Path]
        The graph, and where the bag will be. The sidecar file is written at once.

    Raises
    ------
    AnalysisError
        No study, a subject that may be a name, or a statement that is refused.
    GraphError
        The graph has no recorder.
    """
    from session_analysis.study.layout import Study

    if not _recorders(graph):
        raise GraphError("the graph has no recorder: a visit of a study must be recorded")
    opened = Study(study)
    entry = opened.next_entry(subject, visit)
    opened.add(entry, stated or {})
    named = {"subject": subject, "visit": visit}
    model = entry.source.with_name(f"sub-{subject}_ses-{visit:02d}_subject.yaml")
    usual: dict[str, Any] = {"subject_file": str(model)}
    if stated and "body_mass[kg]" in stated:
        usual["body_mass"] = float(stated["body_mass[kg]"])
    nodes = tuple(
        replace(
            node, parameters={**usual, **_course_record(node, entry), **node.parameters, **named}
        )
        if (node.package, node.executable) == SCREENS
        else node
        for node in _recording_to(graph, entry.source).nodes
    )
    return replace(graph, nodes=nodes), entry.source


def _course_record(node: NodeDescription, entry: Entry) -> dict[str, Any]:
    """Return where the record of a conditioning course is: beside the visits of its subject, so
    that a pseudonym that two studies use is never one subject.
    """
    course = node.parameters.get("course")
    if not course:
        return {}
    name = f"sub-{entry.subject}_course-{Path(str(course)).stem}.yaml"
    return {"course_record": str(entry.source.parents[1] / name)}


def what_follows(graph: Graph, study: Path) -> list[str]:
    """Return the commands that show what a visit of a study gave, one sentence each.

    Parameters
    ----------
    graph
        The graph of the visit, as `in_study` gives it.
    study
        The study's folder.
    """
    sentences = [f"its estimates and report: ankle study run {study}"]
    for node in graph.nodes:
        course, record = node.parameters.get("course"), node.parameters.get("course_record")
        if (node.package, node.executable) == SCREENS and course and record:
            sentences.append(
                f"the course so far, to look at and to print: ankle course {course} --record "
                f"{record} --out {Path(str(record)).stem}"
            )
    return sentences


def with_free_place(graph: Graph, settings: Iterable[str]) -> tuple[Graph, str]:
    """Return the graph with a recorder whose place is free, so that nothing is overwritten.

    Parameters
    ----------
    graph
        A graph, with or without a recorder.
    settings
        What the user set; a place that was set is left as it is.

    Returns
    -------
    tuple[Graph, str]
        The graph, and a sentence where the name was changed, else an empty text.
    """
    for node in _recorders(graph):
        out = str(node.parameters.get("out", ""))
        chosen = any(setting.startswith(f"{node.name}.out=") for setting in settings)
        if not out or chosen or not Path(out).exists():
            continue
        free = next(place for number in count(2) if not (place := Path(f"{out}_{number}")).exists())
        return _recording_to(graph, free), f"{out} is there already; recording into {free}"
    return graph, ""
