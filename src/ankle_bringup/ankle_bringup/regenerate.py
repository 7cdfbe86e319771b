"""Estimates of a recorded session, made again by replay and compared row by row."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ankle_bringup.errors import RunError
from ankle_bringup.graph import load_graph
from ankle_bringup.processes import Processes
from ankle_interfaces.topics import IMPEDANCE_ESTIMATE

ESTIMATE = IMPEDANCE_ESTIMATE.absolute


def regenerate_by_replay(
    bag: Path, out: Path, logs: Path, settings: tuple[str, ...] = (), patience: float = 600.0
) -> None:
    """Replay a bag through a fresh estimator process and record what it says.

    Parameters
    ----------
    bag
        The recorded bag.
    out
        The new bag, with the estimates.
    logs
        Folder for one log file a node.
    settings
        ``node.parameter=value`` for the estimator, as in the recorded run.
    patience
        Longest time that the replay may take [s].

    Raises
    ------
    RunError
        A node failed or the replay did not end in time.
    """
    graph = load_graph("regenerated").with_settings(
        [f"record.out={out}", f"replay.bag={bag}", *settings]
    )
    with Processes(graph, logs) as processes:
        processes.wait_for_end("replay", patience)
        # The recorder last: what the others sent at their end reaches it while it still runs.
        for name in ("impedance_estimator", "emg_processor", "record"):
            code = processes.stop([name])[name]
            if code != 0:
                raise RunError(f"{name} ended with exit code {code} (log: {processes.log(name)})")


@dataclass(frozen=True)
class Agreement:
    """Holds how well two tables of estimates agree.

    Attributes
    ----------
    rows
        Rows with the same time in both.
    only_first, only_second
        Rows that the other lacks.
    largest
        Largest difference of any column, relative to the column's largest value.
    column
        The column in which it is.
    """

    rows: int
    only_first: int
    only_second: int
    largest: float
    column: str


def agreement(columns: tuple[str, ...], first: np.ndarray, second: np.ndarray) -> Agreement:
    """Compare estimates of shape (n, m), the first column being time [s]; NaN agrees with NaN only.

    Raises
    ------
    RunError
        No row in common.
    """
    _, at_first, at_second = np.intersect1d(first[:, 0], second[:, 0], return_indices=True)
    if not len(at_first):
        raise RunError("the two tables of estimates have no time in common")
    a, b = first[at_first], second[at_second]
    scale = np.nanmax(np.abs(a), axis=0, initial=1e-300)
    difference = np.abs(a - b) / scale
    difference[np.isnan(a) & np.isnan(b)] = 0.0
    difference[np.isnan(a) != np.isnan(b)] = np.inf
    worst = np.unravel_index(np.argmax(difference), difference.shape)
    return Agreement(
        len(a),
        len(first) - len(a),
        len(second) - len(b),
        float(difference[worst]),
        columns[int(worst[1])],
    )
