"""The keys of a protocol or a course file."""

from __future__ import annotations

from typing import Any

from biofeedback.errors import ProtocolError


def check_keys(content: Any, allowed: set[str], optional: set[str], where: str) -> None:
    """Check that a table of a file has the keys that it needs and no others.

    Parameters
    ----------
    content
        Content of the file as it was read.
    allowed
        Every key that it may have.
    optional
        Those of them that may be missing.
    where
        File and entry, for the error.

    Raises
    ------
    ProtocolError
        It is no table, or a key is unknown or missing.
    """
    if not isinstance(content, dict):
        raise ProtocolError(
            f"{where}: expected keys {', '.join(sorted(allowed))}; found {content!r}"
        )
    unknown, missing = set(content) - allowed, allowed - optional - set(content)
    if unknown:
        raise ProtocolError(
            f"{where}: unknown key '{min(map(str, unknown))}'; allowed: "
            f"{', '.join(sorted(allowed))}"
        )
    if missing:
        raise ProtocolError(f"{where}: '{min(missing)}' is missing")
