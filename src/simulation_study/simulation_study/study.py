"""Many trials, spread over cores or a cluster; every finished one is kept, so an interrupted study
goes on where it stopped.

Folder of a study::

    study.json            what was asked for
    trials/NAME.json      result of each trial (`estimates.carry_out`), complete or absent

A trial is a function of its content alone: the same seed gives the same study on any number of
workers.
"""

from __future__ import annotations

import asyncio
import json
import logging
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Protocol, TypeVar

import dask
from dask.distributed import Client, LocalCluster, as_completed
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

STUDY_FILE, TRIALS = "study.json", "trials"

# Dask has the allocator give memory back at once; with arrays of a few hundred kB the kernel then
# takes two thirds of the time.
KEEP_MEMORY = {"distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": None}


class Named(Protocol):
    """Describes what a worker carries out: anything with a unique name."""

    @property
    def name(self) -> str:
        """Return the name of the result's file."""


Item = TypeVar("Item", bound=Named)


class StudyError(RuntimeError):
    """Reports a study that cannot begin or go on as asked."""


def run_study(
    trials: Sequence[Item],
    asked: dict[str, Any],
    out: Path,
    task: Callable[[Item], dict[str, Any]],
    workers: int,
    scheduler: str | None = None,
    console: Console | None = None,
    kept_in: str = TRIALS,
) -> dict[str, dict[str, Any]]:
    """Carry out all trials that `out` does not hold yet.

    Parameters
    ----------
    trials
        The trials, each with a name of its own.
    asked
        What the study is; kept, and compared when a study goes on.
    out
        Folder of the study.
    task
        Gives the result of a trial.
    workers
        Processes on this machine; without meaning where `scheduler` is given.
    scheduler
        Address of a running Dask scheduler whose workers have this software.
    console
        Shows the progress; None: standard error.
    kept_in
        Folder of the results within `out`.

    Returns
    -------
    dict[str, dict[str, Any]]
        Result of each trial by name.

    Raises
    ------
    StudyError
        Another study, or something else, is in `out`.
    """
    settle(out, asked)
    folder = out / kept_in
    folder.mkdir(exist_ok=True)
    missing = [trial for trial in trials if not (folder / f"{trial.name}.json").exists()]
    for name, result in _spread(
        task,
        missing,
        len(trials) - len(missing),
        workers,
        scheduler,
        console or Console(stderr=True),
    ):
        _write(folder / f"{name}.json", result)
    return {trial.name: json.loads((folder / f"{trial.name}.json").read_text()) for trial in trials}


def settle(out: Path, asked: dict[str, Any]) -> None:
    """Begin a study in `out`, or go on with the one that is there.

    Raises
    ------
    StudyError
        See `run_study`.
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


def _write(path: Path, result: dict[str, Any]) -> None:
    unfinished = path.with_suffix(".part")
    unfinished.write_text(json.dumps(result))
    os.replace(unfinished, path)


def _named(task: Callable[[Item], dict[str, Any]], trial: Item) -> tuple[str, dict[str, Any]]:
    return trial.name, task(trial)


@contextmanager
def _cluster(workers: int, scheduler: str | None) -> Iterator[Client]:
    """Give Dask workers: those of a running scheduler, or processes on this machine that end with
    the block.
    """
    if scheduler is not None:
        with Client(scheduler, timeout="10s") as client:
            yield client
        return
    with dask.config.set(KEEP_MEMORY):
        cluster = LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            dashboard_address=":0",
            silence_logs=logging.ERROR,
        )
    try:
        with Client(cluster) as client:
            yield client
    finally:
        # Workers on a crowded machine may not end within Dask's few seconds; it then kills them and
        # complains.
        with suppress(TimeoutError, asyncio.TimeoutError):
            cluster.close()


def _spread(
    task: Callable[[Item], dict[str, Any]],
    trials: Sequence[Item],
    done: int,
    workers: int,
    scheduler: str | None,
    console: Console,
) -> Iterator[tuple[str, dict[str, Any]]]:
    if not trials:
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with _cluster(workers, scheduler) as client, Progress(*columns, console=console) as progress:
        bar = progress.add_task("trials", total=done + len(trials), completed=done)
        futures = [client.submit(_named, task, trial, pure=False) for trial in trials]
        for future in as_completed(futures):
            yield future.result()
            future.release()
            progress.advance(bar)
