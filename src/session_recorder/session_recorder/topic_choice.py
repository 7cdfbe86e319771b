"""Which topics of a graph belong in a bag, and by which name. No ROS."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from session_recorder.replaying import ROS_TOPICS

SHARED_TOPICS = (*ROS_TOPICS, "/tf", "/tf_static")
"""Topics that the laboratories of all namespaces share."""


class TopicChoice:
    """Decides which topics are recorded.

    Parameters
    ----------
    named
        Full names of the topics to record; empty: all of the namespace, and those of ROS itself.
    namespace
        Namespace of the recorder.
    """

    def __init__(self, named: Iterable[str], namespace: str) -> None:
        self._named = tuple(named)
        self._prefix = f"{namespace.rstrip('/')}/"

    def wants(self, topic: str) -> bool:
        """Return whether a topic is recorded."""
        if self._named:
            return topic in self._named
        return topic in SHARED_TOPICS or topic.startswith(self._prefix)

    def missing(self, found: Collection[str]) -> list[str]:
        """Return the named topics that are not among those that were found."""
        return [name for name in self._named if name not in found]

    def name_in_bag(self, topic: str) -> str:
        """Return the name without the namespace: a bag holds one laboratory, and whoever reads it
        finds ``/ankle/samples`` whatever the namespace was.
        """
        if topic in SHARED_TOPICS or not topic.startswith(self._prefix):
            return topic
        return f"/{topic.removeprefix(self._prefix)}"
