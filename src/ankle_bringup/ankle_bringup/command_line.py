"""The `ankle` command. Each verb is one file in `ankle_bringup.verbs` and is found there."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import sys
from collections.abc import Callable
from functools import wraps
from importlib.metadata import version
from typing import Annotated, Any

import typer
from typer.core import TyperGroup
from typer.main import get_command

from ankle_bringup import verbs
from ankle_interfaces.error_report import report_error

HELP_OPTIONS = {"help_option_names": ["-h", "--help"]}
_SHARED_OPTIONS = {
    "json": typer.Option("--json", help="Print the result as JSON, and nothing else."),
    "quiet": typer.Option("--quiet", "-q", help="Print errors only."),
}


def verb_names() -> dict[str, str]:
    """Return the verbs: the word on the command line, and the module that has it."""
    modules = sorted(module.name for module in pkgutil.iter_modules(verbs.__path__))
    return {module.rstrip("_").replace("_", "-"): module for module in modules}


class SentenceGroup(TyperGroup):
    """Groups commands, each listed with its whole first sentence: wrapped, not cut at the
    terminal's width.
    """

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands with their sentences."""
        lines = []
        for name in self.list_commands(ctx):
            command = self.get_command(ctx, name)
            if command is not None:
                lines.append((name, command.get_short_help_str(limit=sys.maxsize)))
        with formatter.section("Commands"):
            formatter.write_dl(lines)


class VerbGroup(SentenceGroup):
    """Groups the modules of `ankle_bringup.verbs` as commands; a module is imported when its verb
    is used or listed.
    """

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the verbs in alphabetical order."""
        return [*verb_names()]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return the command of a verb; None where there is no such verb."""
        module = verb_names().get(cmd_name)
        return None if module is None else load_verb(cmd_name, module)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command that the arguments name."""
        # The suggestion for a mistyped verb is made from this table; the modules fill it on demand.
        self.commands = dict.fromkeys(verb_names())  # type: ignore[assignment]
        return super().resolve_command(ctx, args)


def load_verb(name: str, module: str) -> Any:
    """Return the command that a module of `ankle_bringup.verbs` describes.

    Parameters
    ----------
    name
        The word on the command line.
    module
        Name of the module. It has `verb`: a function, or a `typer.Typer` with several. It may have
        `CONTEXT`, settings of the command's context.
    """
    loaded = importlib.import_module(f"{verbs.__name__}.{module}")
    described = loaded.verb
    app = typer.Typer(
        cls=SentenceGroup,
        help=loaded.__doc__,
        add_completion=False,
        rich_markup_mode=None,
        context_settings=HELP_OPTIONS,
    )
    if isinstance(described, typer.Typer):
        app.callback(no_args_is_help=True)(lambda: None)
        parts = [(part.name, part.callback) for part in described.registered_commands]
    else:
        parts = [(name, described)]
    context = {**HELP_OPTIONS, **getattr(loaded, "CONTEXT", {})}
    for word, function in parts:
        app.command(word, context_settings=context)(with_shared_options(function))
    command = get_command(app)
    command.name = name
    return command


def with_shared_options(function: Any) -> Callable[..., Any]:
    """Give a verb's function `--quiet`, and `--json` where it returns its result."""
    signature = inspect.signature(function, eval_str=True)
    names = ["quiet"] if signature.return_annotation is None else ["json", "quiet"]
    shared = [
        inspect.Parameter(
            f"shared_{name}",
            inspect.Parameter.KEYWORD_ONLY,
            default=False,
            annotation=Annotated[bool, _SHARED_OPTIONS[name]],
        )
        for name in names
    ]

    @wraps(function)
    def call(**arguments: Any) -> None:
        from ankle_bringup.terminal import as_json, console

        as_data = arguments.pop("shared_json", False)
        console.quiet = arguments.pop("shared_quiet", False) or as_data
        try:
            result = function(**arguments)
        finally:
            console.quiet = False
        if as_data:
            print(as_json(result))

    del call.__wrapped__  # type: ignore[attr-defined]
    parameters = [*signature.parameters.values(), *shared]
    call.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    call.__annotations__ = {p.name: p.annotation for p in parameters}
    return call


def _show_version(wanted: bool) -> None:
    if wanted:
        print(f"ankle {version('ankle_bringup')}")
        raise typer.Exit()


app = typer.Typer(
    name="ankle",
    cls=VerbGroup,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    # Plain help: units in square brackets are no markup.
    rich_markup_mode=None,
    context_settings=HELP_OPTIONS,
)


@app.callback()
def ankle(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """Work in an ankle-perturbation laboratory: run it, record it, estimate joint impedance.

    'ankle VERB --help' describes a verb, with an example.
    """


def main() -> None:
    """Run the command; an error is one line on stderr, and the exit code tells whose it is."""
    try:
        app()
    except Exception as error:
        sys.exit(report_error(error))


if __name__ == "__main__":
    main()
