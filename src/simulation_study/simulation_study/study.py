"""Many trials, spread over cores or a cluster; every finished one is kept, so an interrupted study
goes on where it stopped.

Folder of a study::

    study.json            what was asked for
    trials/NAME.json      result of each trial (`estimates.carry_out`), complete or absent

A trial is a function of its content alone: the same seed gives the same study on any number of
workers.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar

from rich.console import Console

from simulation_study.study_folder import settle
from simulation_study.study_workers import spread

TRIALS = "trials"


class Named(Protocol):
    """Describes what a worker carries out: anything with a unique name."""

    @property
    def name(self) -> str:
        """Return the name of the result's file."""


Item = TypeVar("Item", bound=Named)


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
    for name, result in spread(
        task,
        {trial.name: (trial,) for trial in missing},
        len(trials) - len(missing),
        "trials",
        workers,
        scheduler,
        console or Console(stderr=True),
    ):
        _write(folder / f"{name}.json", result)
    return {trial.name: json.loads((folder / f"{trial.name}.json").read_text()) for trial in trials}


def _write(path: Path, result: dict[str, Any]) -> None:
    unfinished = path.with_suffix(".part")
    unfinished.write_text(json.dumps(result))
    os.replace(unfinished, path)
