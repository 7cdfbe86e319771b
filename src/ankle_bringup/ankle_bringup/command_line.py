"""The `ankle` command: every verb is a thin door to a package that also works without it."""

from __future__ import annotations

import sys

import typer

from ankle_bringup import bag_verbs, discrepancy_verbs, graph_verbs, rig_verbs, study_verbs

app = typer.Typer(
    name="ankle",
    help="Software of an ankle-perturbation laboratory: run it, record it, estimate joint "
    "impedance from it.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for room in (graph_verbs, rig_verbs, bag_verbs, discrepancy_verbs, study_verbs):
    app.add_typer(room.verbs)


def main() -> None:
    """Run the command; errors that a user can act on are one line on stderr and exit code 1."""
    try:
        app()
    except (ValueError, RuntimeError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
