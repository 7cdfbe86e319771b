"""Models of an earlier diagnosis, which may name terms that the library of this process lacks."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from ankle_interfaces.yaml_text import YamlError, parse_yaml, read_text
from ankle_physics.model import Model
from ankle_physics.term import term_library
from model_discrepancy.errors import DiagnosisError


def require_terms(names: Iterable[str], where: str | Path) -> None:
    """Refuse a file that names a term which the library lacks.

    Parameters
    ----------
    names
        Of the terms in the file.
    where
        The file, for the error.

    Raises
    ------
    DiagnosisError
        One of the names is unknown; says how a term of one's own is read.
    """
    known = term_library()
    for name in names:
        if name not in known:
            raise DiagnosisError(
                f"{where} names the term '{name}', which the library lacks: check the name, or "
                "give the folder of your own terms by --terms FOLDER"
            )


def load_model(path: str | Path) -> Model:
    """Read a model file.

    Parameters
    ----------
    path
        Of the file.

    Raises
    ------
    DiagnosisError
        It names a term that the library lacks.
    ModelError
        It is no model file, or states a value that is not allowed.
    """
    try:
        content = parse_yaml(read_text(path, "model file"))
    except YamlError:
        content = None
    entries = content.get("terms") if isinstance(content, dict) else None
    require_terms(
        (
            str(entry["term"])
            for entry in (entries if isinstance(entries, list) else [])
            if isinstance(entry, dict) and "term" in entry
        ),
        path,
    )
    return Model.load(path)
