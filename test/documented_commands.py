"""Reads the command lines that README and documentation show."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
PAGES = [page for page in PAGES if "reference" not in page.parts]
PROGRAMS = ("ankle ", ".venv/bin/", "make ", "python", "ros2 ", "colcon ", "sudo ", ". install")
"""A line or a piece of code that begins so is a command."""


def commands(page):
    """Return the commands of a page in their order: from code blocks, tables and text.

    ``ankle`` stands for ``.venv/bin/ankle``. What a line says behind a hash is a remark, in which
    ``or: ...`` is another command. A piece of code with ``...`` is only a part of one.
    """
    found = []
    for line in page.read_text().splitlines():
        command, _, remark = line.strip().partition(" #")
        if re.match(r" {4,}|[a-z.]", line) and command.startswith(PROGRAMS) and "`" not in command:
            found += [command.strip(), *re.findall(r"\bor: (.*)$", remark)]
            line = remark
        found += [part for part in re.findall(r"`([^`]+)`", line) if part.startswith(PROGRAMS)]
    found = [line.removesuffix(".") for line in found if "..." not in line]
    return [f".venv/bin/{line}" if line.startswith("ankle ") else line for line in found]
