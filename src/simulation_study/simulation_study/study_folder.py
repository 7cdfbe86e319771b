"""The folder of a study holds what was asked for; another study never goes on in it."""

from __future__ import annotations

import json
import os
from contextlib import suppress
from pathlib import Path
from typing import Any
from uuid import uuid4

from ankle_interfaces.errors import UserError

STUDY_FILE = "study.json"


class StudyError(UserError, RuntimeError):
    """Reports a study that cannot begin or go on as asked."""


def settle(out: Path, asked: dict[str, Any]) -> None:
    """Begin a study in `out`, or go on with the one that is there.

    Parameters
    ----------
    out
        Folder of the study; it need not exist.
    asked
        What the study is, ready for JSON.

    Raises
    ------
    StudyError
        Another study, or something else, is in `out`.
    """
    file = out / STUDY_FILE
    if not file.exists():
        _begin(out, asked)
    there = json.loads(file.read_text())
    if there != asked:
        different = ", ".join(
            f"{key} {there.get(key)} instead of {asked[key]}"
            for key in asked
            if asked[key] != there.get(key)
        )
        raise StudyError(
            f"{out} holds a study with {different}; nothing is overwritten, choose another folder"
        )


def _begin(out: Path, asked: dict[str, Any]) -> None:
    """Write what is asked for; another part of the study may do so at the same moment."""
    out.mkdir(parents=True, exist_ok=True)
    others = any(not one.name.startswith(STUDY_FILE) for one in out.iterdir())
    if others and not (out / STUDY_FILE).exists():
        raise StudyError(
            f"{out} is there and is not a study; nothing is overwritten, choose another folder"
        )
    # The file is there with all that it holds, or not at all.
    whole = out / f"{STUDY_FILE}.{uuid4().hex}"
    whole.write_text(json.dumps(asked, indent=1))
    with suppress(FileExistsError):
        os.link(whole, out / STUDY_FILE)
    whole.unlink()
