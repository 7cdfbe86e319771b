"""Physical effects of one's own: a folder of term files beside those in `ankle_physics.terms`."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path

from ankle_physics.errors import ModelError
from ankle_physics.term import Term, forget_library, term_library

_PACKAGE = "ankle_own_terms"
_NAME = re.compile(r"[a-z][a-z0-9_]*")
_known: dict[Path, tuple[str, ...]] = {}


def load_terms(folder: str | Path) -> tuple[str, ...]:
    """Add the terms in a folder to the library of this process.

    The files are Python and are run: give a folder that you trust.

    Parameters
    ----------
    folder
        Of ``*.py`` files with subclasses of `ankle_physics.term.Term`; an empty name adds nothing.

    Returns
    -------
    tuple[str, ...]
        Names of the terms that the folder holds.

    Raises
    ------
    ModelError
        No such folder, a file that cannot be run, no term in it, a name that is taken, or a term
        that lacks what the library needs; names the file.
    """
    if not str(folder):
        return ()
    place = Path(folder).resolve()
    if place in _known:
        return _known[place]
    if not place.is_dir():
        raise ModelError(f"{folder} is no folder of terms")
    files = sorted(file for file in place.glob("*.py") if file.name != "__init__.py")
    found: list[str] = []
    for number, file in enumerate(files):
        found += _read(file, f"{_PACKAGE}.{len(_known)}_{number}_{file.stem}")
    if not found:
        raise ModelError(f"{folder} holds no term: a *.py file with a subclass of Term")
    forget_library()
    _known[place] = tuple(sorted(found))
    return _known[place]


def _read(file: Path, module_name: str) -> list[str]:
    """Return the names of the terms in one file, checked."""
    taken = dict(term_library())
    spec = importlib.util.spec_from_file_location(module_name, file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[module_name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[module_name]
        raise ModelError(f"{file}: cannot be run: {type(error).__name__}: {error}") from error
    terms = [
        value
        for value in vars(module).values()
        if isinstance(value, type)
        and issubclass(value, Term)
        and value.__module__ == module_name
        and "name" in vars(value)
    ]
    for term in terms:
        try:
            _check(file, term, taken)
        except ModelError:
            del sys.modules[module_name]
            raise
        taken[term.name] = term
    return [term.name for term in terms]


def _check(file: Path, term: type[Term], taken: dict[str, type[Term]]) -> None:
    for attribute in ("place", "sentence", "parameters"):
        if not hasattr(term, attribute):
            raise ModelError(f"{file}: term '{term.name}' does not state '{attribute}'")
    if not _NAME.fullmatch(term.name):
        raise ModelError(f"{file}: term name '{term.name}' is not like 'maxwell_relaxation'")
    if term.name in taken:
        raise ModelError(
            f"{file}: term '{term.name}' is taken by {taken[term.name].__module__}; choose another"
        )
