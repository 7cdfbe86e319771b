"""Reading YAML that somebody else wrote: content, or one error for everything that can be wrong."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Any

import yaml

from ankle_interfaces.errors import UserError

LARGEST_FILE = 10_000_000
"""[bytes] Longest file that is read: a model, a protocol or a rig file has some thousand."""


class YamlError(UserError, ValueError):
    """Reports text that is no YAML, or a file that is no text."""


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


def read_text(path: str | Path, kind: str = "file") -> str:
    """Return the text of a file.

    Parameters
    ----------
    path
        Path of the file.
    kind
        What such a file is, as in ``model file``, for the error.

    Raises
    ------
    YamlError
        Not UTF-8, or longer than 10 MB.
    OSError
        The file cannot be read; names what was to be there where there is none.
    """
    try:
        with Path(path).open("rb") as stream:
            data = stream.read(LARGEST_FILE + 1)
    except (FileNotFoundError, NotADirectoryError):
        raise FileNotFoundError(f"no {kind} at {path}") from None
    except IsADirectoryError:
        raise IsADirectoryError(f"{path} is a folder and no {kind}") from None
    if len(data) > LARGEST_FILE:
        raise YamlError(f"longer than {LARGEST_FILE / 1e6:g} MB")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise YamlError(f"no UTF-8 text: byte {error.start} is 0x{data[error.start]:02x}") from None


def load_named(name: str, package: str, folder: str, kind: str) -> tuple[Any, str]:
    """Return the content and the text of a YAML file of a package, or of one's own.

    Parameters
    ----------
    name
        Name of a file of the package without ``.yaml``, or the path of a YAML file.
    package, folder
        Where the package keeps its files, as in ``biofeedback``, ``config/courses``.
    kind
        What such a file is, for the error.

    Raises
    ------
    YamlError
        No such file, or it cannot be read; the message is complete.
    """
    path = Path(name)
    if path.suffix in (".yaml", ".yml"):
        source = path
    else:
        with resources.as_file(resources.files(package)) as root:
            source = root / folder / f"{name}.yaml"
    if not source.is_file():
        raise YamlError(
            f"no {kind} '{name}': known are {', '.join(names_in(package, folder))}, or give the "
            "path of a .yaml file"
        )
    try:
        text = read_text(source)
        return parse_yaml(text), text
    except YamlError as error:
        raise YamlError(f"{name}: {error}") from None


def names_in(package: str, folder: str) -> list[str]:
    """Return the names of a package's YAML files, without their ending, sorted."""
    entries = resources.files(package).joinpath(*folder.split("/")).iterdir()
    names = [entry.name for entry in entries]
    return sorted(name.removesuffix(".yaml") for name in names if name.endswith(".yaml"))
