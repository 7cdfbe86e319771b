"""The pages of reference that are made from the code: topics, verbs, nodes, terms, functions."""

from __future__ import annotations

import ast
import importlib
import inspect
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]


def write_reference(folder: Path) -> None:
    """Write every generated page into a folder; pages that did not change are left alone."""
    folder.mkdir(exist_ok=True)
    pages = {
        "topics": topics_page(),
        "verbs": verbs_page(),
        "nodes": nodes_page(),
        "terms": terms_page(),
        **{f"api_{package}": api_page(package) for package in packages()},
    }
    api = "\n".join(f"api_{package}" for package in packages())
    pages["api"] = (
        "# Functions and classes\n\nEach package, with its modules.\n\n"
        f"```{{toctree}}\n:maxdepth: 1\n\n{api}\n```\n"
    )
    for name, text in pages.items():
        path = folder / f"{name}.md"
        if not path.exists() or path.read_text() != text:
            path.write_text(text)


def packages() -> list[str]:
    """The packages of this workspace."""
    return sorted(path.parent.name for path in ROOT.glob("src/*/package.xml"))


def topics_page() -> str:
    """Every topic with its message, its delivery and its columns."""
    from ankle_interfaces.topics import TOPICS

    parts = [
        "# Topics\n\nNames are relative; a leading slash says that a namespace does not apply.\n"
    ]
    for topic in TOPICS:
        rate = "at events" if topic.rate is None else f"{topic.rate:g} Hz"
        parts.append(
            f"## {topic.name}\n\n{topic.description}\n\n"
            f"`{topic.message}`, {rate}; {topic.delivery.value}.\n"
        )
        rows = [
            f"| `{column}` | {'no' if column in topic.optional else 'yes'} |"
            for column in topic.columns
        ]
        if rows:
            parts.append("| column | in every block |\n| --- | --- |\n" + "\n".join(rows) + "\n")
    return "\n".join(parts)


def verbs_page() -> str:
    """Every verb of the `ankle` command with its help."""
    from typer.testing import CliRunner

    from ankle_bringup.command_line import app, load_verb, verb_names

    parts = ["# Verbs\n\nEach verb of the `ankle` command, as `ankle VERB --help` shows it.\n"]
    for name, module in verb_names().items():
        words = [[name]]
        command = load_verb(name, module)
        words += [[name, part] for part in getattr(command, "commands", {})]
        for path in words:
            shown = CliRunner().invoke(app, [*path, "--help"], env={"COLUMNS": "90"}).output
            level = "#" * (len(path) + 1)
            parts.append(f"{level} ankle {' '.join(path)}\n\n```text\n{shown.strip()}\n```\n")
    return "\n".join(parts)


def nodes() -> list[EntryPoint]:
    """The executables that are nodes, in alphabetical order."""
    own = [e for e in entry_points(group="console_scripts") if e.module.endswith("_node")]
    found = {e.value: e for e in own if e.module.partition(".")[0] in packages()}
    return sorted(found.values(), key=lambda entry: entry.name)


def nodes_page() -> str:
    """Every node with its topics and its parameters."""
    from ankle_bringup.executables import declared_parameters

    parts = ["# Nodes: topics and parameters\n"]
    for entry in nodes():
        module = importlib.import_module(entry.module)
        package = entry.module.partition(".")[0]
        parts.append(f"## {entry.name}\n\nPackage `{package}`.\n\n{_paragraphs(module.__doc__)}\n")
        declared = declared_parameters(entry, {})
        if declared:
            rows = [("parameter", "default", "allowed", "what it is"), ("---",) * 4]
            rows += [
                (f"`{p.name}`", _cell(p.default), _cell(p.allowed), _cell(p.explanation))
                for p in declared.values()
            ]
            parts.append("\n".join(f"| {' | '.join(row)} |" for row in rows) + "\n")
    return "\n".join(parts)


def _cell(value: Any) -> str:
    text = " ".join(str(value).split()).replace("|", "\\|")
    return text or "(empty)"


def _paragraphs(text: str | None) -> str:
    return inspect.cleandoc(text or "")


def terms_page() -> str:
    """Every term of the joint with its equation and its parameters."""
    from ankle_physics import terms

    parts = ["# Terms of the joint and the rig\n"]
    for path in sorted(Path(next(iter(terms.__path__))).glob("[a-z]*.py")):
        text = ast.get_docstring(ast.parse(path.read_text())) or ""
        parts.append(f"## {path.stem}\n\n```text\n{text}\n```\n")
    return "\n".join(parts)


def api_page(package: str) -> str:
    """The modules of a package, each read from its docstrings."""
    folder = ROOT / "src" / package / package
    modules = []
    for path in sorted(folder.rglob("*.py")):
        parts = path.relative_to(folder.parent).with_suffix("").parts
        if (path.stem.startswith("_") and path.stem != "__init__") or "verbs" in parts:
            continue
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        modules.append(name)
    shown = "\n".join(
        # What a package exports is described with the module that has it.
        f"## {name}\n\n```{{eval-rst}}\n.. automodule:: {name}\n"
        f"{'' if name == package else '   :members:' + chr(10)}```\n"
        for name in modules
    )
    return f"# {package}\n\n{shown}"
