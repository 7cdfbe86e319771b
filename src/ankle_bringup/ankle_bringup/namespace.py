"""The namespace of a laboratory, as it is typed and as ROS wants it."""

from __future__ import annotations

import re

from ankle_bringup.errors import GraphError

_NAMESPACE = re.compile(r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*/?", re.ASCII)


def absolute_namespace(namespace: str) -> str:
    """Return a namespace with its slash, as ``/left``; empty for the root.

    Parameters
    ----------
    namespace
        As it is typed, with or without slashes.

    Raises
    ------
    GraphError
        No name that ROS accepts.
    """
    if not namespace.strip("/"):
        return ""
    if not _NAMESPACE.fullmatch(namespace):
        raise GraphError(
            f"namespace '{namespace}' is refused; allowed: letters, digits and '_', parts "
            "joined by '/', none beginning with a digit, as in 'left'"
        )
    return f"/{namespace.strip('/')}"
