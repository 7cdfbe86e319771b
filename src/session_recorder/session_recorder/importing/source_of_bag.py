"""What a bag says of the file that it was imported from: enough to know that file again, and no
name, because a file's name may hold a person's.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

from session_recorder.importing.statement import QUANTITIES

NAME_PLACEHOLDER = "(source)"
"""Stands in a bag where a title or a column bears the name of the file."""

_READ_BYTES = 2**20  # at once, so that a file of gigabytes does not fill the memory
_DIGITS_IN_BAG_NAME = 8  # of the digest: two of a thousand files share them once in 10 000 studies


def sha256_of(source: Path) -> str:
    """Return the SHA-256 of a file's content in hexadecimal digits."""
    digest = hashlib.sha256()
    with source.open("rb") as stream:
        while part := stream.read(_READ_BYTES):
            digest.update(part)
    return digest.hexdigest()


def default_bag(source: Path, keep_name: bool) -> Path:
    """Return how a bag is called where nothing is stated: after the content of its file, or after
    the file's name where that is kept.
    """
    if keep_name or not source.is_file():
        return Path(source.stem)
    return Path(f"imported_{sha256_of(source)[:_DIGITS_IN_BAG_NAME]}")


def source_record(source: Path, keep_name: bool) -> dict[str, str]:
    """Return the pairs by which a bag states its file.

    Parameters
    ----------
    source
        The file.
    keep_name
        Whether its name is stated as well.

    Returns
    -------
    dict[str, str]
        Digest, format and size [bytes]; the name where it is kept.
    """
    record = {
        "source_sha256": sha256_of(source),
        "source_format": source.suffix.lower(),
        "source_size[B]": str(source.stat().st_size),
    }
    return {**record, "imported_from": source.name} if keep_name else record


def without_name(text: str, source: Path) -> str:
    """Return a text of the file, as a sheet's title, without the file's name.

    A file that is called after a quantity, as ``torque.csv``, names nobody; a single letter
    neither. Inside a longer word the same letters are no name.
    """
    stem = source.stem
    if len(stem) < 2 or stem.lower() in QUANTITIES:
        return text
    letter = r"[^\W\d_]"
    return re.sub(
        rf"(?<!{letter}){re.escape(stem)}(?!{letter})", NAME_PLACEHOLDER, text, flags=re.I
    )
