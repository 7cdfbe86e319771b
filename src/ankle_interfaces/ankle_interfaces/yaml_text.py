"""Reading YAML that somebody else wrote: content, or one error for everything that can be wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

LARGEST_FILE = 10_000_000
"""[bytes] Longest file that is read: a model, a protocol or a rig file has some thousand."""


class YamlError(ValueError):
    """Text that is no YAML, or a file that is no text."""


def parse_yaml(text: str) -> Any:
    """Return the content of a YAML text.

    Raises
    ------
    YamlError
        Not YAML, a date that does not exist, or nested too deeply.
    """
    try:
        return yaml.safe_load(text)
    except RecursionError:
        raise YamlError("not YAML: nested too deeply") from None
    except (yaml.YAMLError, ValueError, OverflowError, TypeError) as error:
        raise YamlError(f"not YAML: {error}") from None


def read_text(path: str | Path) -> str:
    """Return the text of a file.

    Raises
    ------
    YamlError
        Not UTF-8, or longer than 10 MB.
    OSError
        The file cannot be read.
    """
    with Path(path).open("rb") as stream:
        data = stream.read(LARGEST_FILE + 1)
    if len(data) > LARGEST_FILE:
        raise YamlError(f"longer than {LARGEST_FILE / 1e6:g} MB")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise YamlError(f"no UTF-8 text: byte {error.start} is 0x{data[error.start]:02x}") from None
