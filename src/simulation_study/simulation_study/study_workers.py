"""Tasks of a study, spread over the cores of this machine or over a Dask cluster."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

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

# Dask has the allocator give memory back at once; with arrays of a few hundred kB the kernel then
# takes two thirds of the time.
KEEP_MEMORY = {"distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": None}
# Long enough for a busy machine; a wrong address is then named.
SCHEDULER_TIMEOUT = "10s"


@contextmanager
def _cluster(workers: int, scheduler: str | None) -> Iterator[Client]:
    """Give Dask workers: those of a running scheduler, or processes on this machine that end with
    the block.
    """
    if scheduler is not None:
        with Client(scheduler, timeout=SCHEDULER_TIMEOUT) as client:
            yield client
        return
    with dask.config.set(KEEP_MEMORY):
        cluster = LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
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


def spread(
    task: Callable[..., Any],
    jobs: Mapping[str, tuple[Any, ...]],
    done: int,
    what: str,
    workers: int,
    scheduler: str | None,
    console: Console,
) -> Iterator[tuple[str, Any]]:
    """Return the results of ``task(*arguments)`` as they finish, and show the progress.

    Parameters
    ----------
    task
        Carries out a job; workers import it by its name.
    jobs
        Arguments of each job, by the job's name.
    done
        Jobs that were finished before, for the progress.
    what
        Title of the progress.
    workers
        Processes on this machine; without meaning where `scheduler` is given.
    scheduler
        Address of a running Dask scheduler whose workers have this software.
    console
        Shows the progress.

    Raises
    ------
        Whatever a task raises, after the others that were finished have been given out.
    """
    if not jobs:
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with _cluster(workers, scheduler) as client, Progress(*columns, console=console) as progress:
        bar = progress.add_task(what, total=done + len(jobs), completed=done)
        futures = {
            client.submit(task, *arguments, pure=False): name for name, arguments in jobs.items()
        }
        for future in as_completed(list(futures)):
            yield futures[future], future.result()
            future.release()
            progress.advance(bar)
