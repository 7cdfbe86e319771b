"""The file of a protocol or a course, and its keys."""

from __future__ import annotations

import hashlib
from typing import Any

from ankle_interfaces.yaml_text import YamlError, load_named
from biofeedback.errors import ProtocolError


def load_plan(name: str, folder: str, kind: str) -> tuple[Any, str]:
    """Read a plan by the name of one in the package, or by the path of a YAML file.

    Parameters
    ----------
    name
        Name or path.
    folder
        The package's folder of such plans.
    kind
        What it is a plan of, for the error.

    Returns
    -------
    tuple of (object, str)
        What the file holds, and a digest that tells one plan from another.

    Raises
    ------
    ProtocolError
        No such file, or not YAML.
    """
    try:
        content, text = load_named(name, "biofeedback", folder, kind)
    except YamlError as error:
        raise ProtocolError(str(error)) from None
    return content, hashlib.sha256(text.encode()).hexdigest()[:16]


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
