"""`estimate`: impedance from a recorded bag, without a running graph."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress
from rich.table import Table

from ankle_interfaces.quantity import quantities
from impedance_estimator.algorithms import ALGORITHMS, DEFAULT
from impedance_estimator.known_physics import load_known_physics
from impedance_estimator.offline.recorded_estimates import OfflineResult, estimate_bag
from impedance_estimator.settings import HIGHPASS_CHOICES
from impedance_estimator.stream import compile_estimator

_DIGITS = 4
"""Shown of each value; standard errors are a few per cent."""


def estimate(
    bag: Annotated[Path, typer.Argument(help="A bag with /ankle/samples.")],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="Write /impedance/estimate and /impedance/reflex_irf there."
        ),
    ] = None,
    algorithm: Annotated[str, typer.Option(help=f"One of {', '.join(ALGORITHMS)}.")] = DEFAULT,
    highpass: Annotated[
        str | None, typer.Option(help=f"CE, C and O: one of {', '.join(HIGHPASS_CHOICES)}.")
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(help="The subject's model (YAML), whose terms run beside the regression."),
    ] = None,
    rig: Annotated[
        Path | None, typer.Option(help="The calibrated rig (rig.yaml) the bag was recorded on.")
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace the bag at --out.")
    ] = False,
) -> None:
    """Estimate K, B, I and G from a recorded bag and show their medians over the valid time.

    Example: estimate session_3 --out session_3_impedance --algorithm CE --highpass all
    """
    console = Console()
    if algorithm not in ALGORITHMS:
        raise ValueError(f"algorithm '{algorithm}' is not known; allowed: {', '.join(ALGORITHMS)}")
    settings_type = ALGORITHMS[algorithm].settings_type
    if highpass is not None and "highpass" not in quantities(settings_type):
        raise ValueError(f"algorithm '{algorithm}' has no --highpass")
    with Progress(console=Console(stderr=True), transient=True) as bar:
        bar.add_task("compiling (20 s the first time, simultaneous two minutes)", total=None)
        compile_estimator(algorithm)
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(f"{algorithm} on {bag.name}", total=1.0)
        settings = settings_type() if highpass is None else settings_type(highpass=highpass)  # type: ignore[call-arg]
        result = estimate_bag(
            bag,
            out,
            algorithm,
            settings,
            known=load_known_physics(str(model or ""), str(rig or "")),
            overwrite=overwrite,
            progress=lambda share: bar.update(task, completed=share),
        )
    for note in result.notes:
        console.print(note, highlight=False)
    console.print(_table(result))
    if out is not None:
        console.print(f"{len(result.rows)} estimates in {out}", highlight=False)


def _table(result: OfflineResult) -> Table:
    median = result.median()
    table = Table(
        "",
        "median",
        "standard error",
        title=f"{len(result.valid)} of {len(result.rows)} estimates valid",
    )
    for name, value in median.items():
        if not name.startswith("se_"):
            error = median.get(f"se_{name}")
            table.add_row(
                escape(name), f"{value:.{_DIGITS}g}", "" if error is None else f"{error:.2g}"
            )
    return table


def main() -> None:
    """Entry point of ``ros2 run impedance_estimator estimate``; an error is one line on stderr and
    exit code 1.
    """
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    app.command()(estimate)
    try:
        app()
    except (ValueError, RuntimeError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(1)
