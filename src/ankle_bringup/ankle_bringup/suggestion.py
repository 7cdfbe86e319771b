"""A name that nobody knows is refused with the name that was probably meant."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

from ankle_bringup.errors import GraphError


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
        The name is not among them; has a suggestion where one is similar, and the known names.
    """
    names = sorted(known)
    if name in names:
        return
    similar = get_close_matches(name, names, n=1)
    suggestion = f"did you mean '{similar[0]}'? " if similar else ""
    raise GraphError(
        f"no {kind} is named '{name}'; {suggestion}known: {', '.join(names) or 'none'}"
    )
