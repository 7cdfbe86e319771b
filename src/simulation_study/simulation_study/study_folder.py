"""The folder of a study holds what was asked for; another study never goes on in it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

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
    if file.exists():
        there = json.loads(file.read_text())
        if there != asked:
            different = ", ".join(
                f"{key} {there.get(key)} instead of {asked[key]}"
                for key in asked
                if asked[key] != there.get(key)
            )
            raise StudyError(
                f"{out} holds a study with {different}; nothing is overwritten, choose another "
                "folder"
            )
        return
    if out.exists() and any(out.iterdir()):
        raise StudyError(
            f"{out} is there and is not a study; nothing is overwritten, choose another folder"
        )
    out.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(asked, indent=1))
