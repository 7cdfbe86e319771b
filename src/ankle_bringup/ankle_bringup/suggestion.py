"""A name on the command line that nobody knows is refused."""

from __future__ import annotations

from collections.abc import Iterable

from ankle_bringup.errors import GraphError
from ankle_interfaces.suggestion import hint


def require_known(kind: str, name: str, known: Iterable[str]) -> None:
    """Refuse an unknown name.

    Parameters
    ----------
    kind
        What is named, as in "parameter of ankle_sim".
    name
        The name as it was typed.
    known
        All names that would be accepted.

    Raises
    ------
    GraphError
        The name is not among them; has a suggestion where one is similar, else the known names.
    """
    names = set(known)
    if name not in names:
        raise GraphError(f"no {kind} is named '{name}'; {hint(name, names)}")
