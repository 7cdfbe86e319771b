"""Every recording of a study on all cores, or on a Dask cluster; resumable."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ankle_node.parent_process import end_with_parent
from session_analysis.errors import AnalysisError
from session_analysis.study.layout import Entry, Study
from session_analysis.study.recording_results import Row, process

Progress = Callable[[str, float], None]


def run_study(
    study: Study,
    workers: int,
    scheduler: str | None = None,
    diagnosed: bool = True,
    progress: Progress | None = None,
) -> tuple[list[Row], dict[str, str]]:
    """Process every recording, and write all results into one Parquet table.

    Parameters
    ----------
    study
        The study whose recordings are processed.
    workers
        Processes on this machine.
    scheduler
        Address of a running Dask scheduler instead. Its workers must see the study's folder.
    diagnosed
        Whether each recording is diagnosed as well.
    progress
        Called with the recording that is done and the fraction of all.

    Returns
    -------
    tuple[list[Row], dict[str, str]]
        The table's rows, and why a recording gave none, by its name. A recording whose files have
        not changed since an earlier run is not computed again.

    Raises
    ------
    AnalysisError
        The study has no recording.
    """
    entries = study.entries()
    if not entries:
        raise AnalysisError(
            f"{study.folder} has no recording; record one with 'ankle up rig --study "
            f"{study.folder} --subject S01 --visit 1', or add a file with 'ankle study add'"
        )
    rows: dict[str, list[Row]] = {}
    failures: dict[str, str] = {}
    folder = study.folder.resolve()
    with _executor(min(workers, len(entries)), scheduler) as submit:
        futures = {submit(_try, folder, entry, diagnosed): entry for entry in entries}
        for done, (name, found, reason) in enumerate(_results(futures, scheduler), 1):
            if reason:
                failures[name] = reason
            else:
                rows[name] = found
            if progress:
                progress(name, done / len(entries))
    ordered = [row for entry in entries for row in rows.get(entry.name, [])]
    write_results(ordered, study.results)
    lines = (f"{name}: {' '.join(why.split())}\n" for name, why in failures.items())
    study.failures_file.write_text("".join(lines), encoding="utf-8")
    return ordered, failures


def _try(folder: Path, entry: Entry, diagnosed: bool) -> tuple[str, list[Row], str]:
    """Process one recording; an error of its data must not end the others."""
    try:
        return entry.name, process(folder, entry, diagnosed), ""
    except (ValueError, OSError, ArithmeticError) as error:
        ours = type(error).__module__ != "builtins"  # says enough without the error's name
        return entry.name, [], str(error) if ours else f"{type(error).__name__}: {error}"


@contextmanager
def _executor(workers: int, scheduler: str | None) -> Iterator[Callable[..., Any]]:
    if scheduler is None:
        # Fresh processes: compiled code and threads of this one are not copied halfway.
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(workers, context, end_with_parent) as pool:
            yield pool.submit
        return
    from dask.distributed import Client

    with Client(scheduler, timeout="10s") as client:
        yield lambda task, *arguments: client.submit(task, *arguments, pure=False)


def _results(futures: dict[Any, Entry], scheduler: str | None) -> Iterator[Any]:
    if scheduler is None:
        finished: Any = as_completed(futures)
    else:
        from dask.distributed import as_completed as dask_completed

        finished = dask_completed(list(futures))
    for future in finished:
        try:
            yield future.result()
        except Exception as error:  # a worker that died; the others go on
            yield futures[future].name, [], f"{type(error).__name__}: {error}"


def write_results(rows: Sequence[Row], path: Path) -> None:
    """Write rows as a Parquet table that pandas, R and DuckDB open.

    Parameters
    ----------
    rows
        One row a recording.
    path
        Replaced; its folder is made where it is missing.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = pa.schema(
        [
            ("subject", pa.string()),
            ("visit", pa.int32()),
            ("run", pa.int32()),
            ("quantity", pa.string()),
            ("value", pa.float64()),
            ("error", pa.float64()),
            ("doubt", pa.float64()),
        ]
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    pq.write_table(pa.Table.from_pylist([asdict(row) for row in rows], schema=schema), part)
    part.replace(path)


def read_results(path: Path) -> list[Row]:
    """Read the rows of a table of results.

    Raises
    ------
    AnalysisError
        There is none yet.
    """
    import pyarrow.parquet as pq

    if not path.exists():
        raise AnalysisError(f"{path} is not there yet; make it with 'ankle study run'")
    return [Row(**row) for row in pq.read_table(path).to_pylist()]
