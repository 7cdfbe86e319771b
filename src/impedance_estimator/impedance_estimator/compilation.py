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
    return _compiled(function, counting=True)


def sample_part(function: Function) -> Function:
    """Compile a function of the path of every sample, which makes no array, as `part` does.

    Without numba's reference counts, and as part of its caller: counting each array of a state up
    and down, or handing it on, would take as long as the computation.
    """
    return _compiled(function, counting=False)


def _compiled(function: Function, counting: bool) -> Function:
    # A function takes from its caller what is not said here. numba's type stubs lack the options.
    options: dict[str, Any] = {
        "no_cpython_wrapper": True,
        "no_cfunc_wrapper": True,
        "error_model": "numpy",
        "_nrt": counting,
        "forceinline": not counting,
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
