"""The name that was probably meant, for a name that nobody knows."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from difflib import get_close_matches

SUGGESTION = 0.6
"""Least similarity of two names, by difflib, with which one is suggested: difflib's own choice."""
TYPING_ERROR = 0.8
"""Least similarity with which a name is a typing error of another one: one letter left out of five;
``rate`` and ``date`` are two names."""


def closest(name: str, known: Collection[str], similarity: float = SUGGESTION) -> str | None:
    """Return the known name that is most similar to an unknown one; None where none is.

    Parameters
    ----------
    name
        As it was typed.
    known
        Names that would be accepted.
    similarity
        Least similarity, 0 to 1.
    """
    close = get_close_matches(name, known, n=1, cutoff=similarity)
    # Letters that changed places count twice for difflib.
    close = close or [other for other in known if sorted(other) == sorted(name)]
    return close[0] if close else None


def hint(name: str, known: Iterable[str]) -> str:
    """Return the end of the sentence about an unknown name: the one that may be meant, or all."""
    names = sorted(known)
    meant = closest(name, names)
    return f"did you mean '{meant}'?" if meant else f"known: {', '.join(names) or 'none'}"
