"""The estimators are compiled with these options of numba, and its cache on disk is renewed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar
from zlib import crc32

from numba import njit

Function = TypeVar("Function", bound=Callable[..., Any])


def part(function: Function) -> Function:
    """Compile a function that only compiled code calls.

    It gets no entry from Python: for the dozens of arrays of a state that entry takes longer to
    compile than the function. Division by zero gives infinity or NaN, as in numpy, instead of an
    exception that nothing could catch.
    """
    # numba documents these options; its type stubs lack them.
    options: dict[str, Any] = {
        "no_cpython_wrapper": True,
        "no_cfunc_wrapper": True,
        "error_model": "numpy",
    }
    return njit(**options)(function)


def source_fingerprint() -> int:
    """Return a number that changes with the source of any compiled module of this package.

    numba's cache on disk looks at one file only. A function that has this number in its closure
    gets a new entry in the cache when any of the files that it calls has changed.
    """
    value = 0
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        source = path.read_bytes()
        if b"import njit" in source or b"import part" in source or b"compilation import" in source:
            value = crc32(source, value)
    return value
