"""The robustness study: recordings of the independent rig once, estimates for each version of the
estimators.

Folder of a study::

    study.json                 what was asked for
    recordings/NAME.npz        signals and truth
    estimates_HASH/NAME.json   results of one version of the estimators' code
    robustness.md, robustness.png
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from simulation_study.robustness.conditions import (
    FULL_SIZE,
    QUICK_SIZE,
    Condition,
    conditions,
    in_drawn_order,
)
from simulation_study.robustness.estimation import estimate_condition, fingerprint
from simulation_study.robustness.report import write_report
from simulation_study.study import run_study
from simulation_study.study_folder import StudyError

RECORDINGS = "recordings"


def robustness(
    out: Path,
    seed: int,
    quick: bool,
    workers: int,
    seconds: float | None = None,
    recordings: int | None = None,
    scheduler: str | None = None,
    console: Console | None = None,
    repeats: int = 1,
    effects: Sequence[str] = (),
) -> str:
    """Run the study, or go on with it, or estimate again where the estimators changed.

    Parameters
    ----------
    out
        Folder of the study.
    seed
        Draws subjects, perturbations, courses and noise.
    quick
        24 recordings of 60 s instead of 159 of 120 s.
    workers
        Processes on this machine; without meaning where `scheduler` is given.
    seconds
        Length of a recording; None: 120, or 60 where `quick` is set.
    recordings
        Only the first so many, in an order that the seed draws; None: all. A larger number goes on
        with the results of a smaller one.
    scheduler
        Address of a running Dask scheduler.
    console
        Shows the progress.
    repeats
        So many recordings where there is one by default, each of another subject, with both servos.
    effects
        Only the recordings with these effects; none: all.

    Returns
    -------
    str
        The tables as markdown; they stand in ``robustness.md`` too.

    Raises
    ------
    StudyError
        Another study, or something else, is in `out`; or no recording has such an effect.
    """
    size = QUICK_SIZE if quick else FULL_SIZE
    if seconds is not None:
        size = replace(size, seconds=seconds)
    size = size.repeated(repeats)
    planned = in_drawn_order(conditions(size, seed), seed)
    asked = {"study": "robustness", "seed": seed, "quick": quick, "seconds": size.seconds}
    if repeats > 1:
        asked["repeats"] = repeats
    if effects:
        planned = with_effects(planned, effects)
        asked["effects"] = sorted(effects)
    planned = planned[:recordings]
    results = run_study(
        planned,
        asked,
        out,
        estimate_condition(out.resolve() / RECORDINGS),
        workers,
        scheduler,
        console,
        kept_in=f"estimates_{fingerprint()}",
    )
    command = f"ankle robustness --seed {seed} --seconds {size.seconds:g}"
    command += " --quick" if quick else ""
    command += f" --repeats {repeats}" if repeats > 1 else ""
    command += "".join(f" --effect {name}" for name in effects)
    command += f" --recordings {recordings}" if recordings is not None else ""
    return write_report(results, out, command)


def with_effects(planned: Sequence[Condition], effects: Sequence[str]) -> list[Condition]:
    """Return the recordings with some effects, in their order.

    Parameters
    ----------
    planned
        All recordings of the study.
    effects
        Names in `blind_rig.effects`.

    Raises
    ------
    StudyError
        No recording has one of them.
    """
    known = {condition.effect for condition in planned}
    for name in effects:
        if name not in known:
            raise StudyError(f"no effect '{name}' in this study; it has {', '.join(sorted(known))}")
    return [condition for condition in planned if condition.effect in effects]
