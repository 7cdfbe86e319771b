"""Reads the command lines that README and documentation show."""

import re
import shlex
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
PAGES = [page for page in PAGES if "reference" not in page.parts]
# Hidden folders hold what others wrote: packages leave pages in an environment.
PAGES += sorted([*ROOT.glob("[!.]*/README.md"), *ROOT.glob("src/*/README.md")])
VARIABLE = r"[A-Z_]+=\S+ "
"""A variable of the environment, set for one command."""
PROGRAMS = (
    *("ankle ", ".venv/bin/", "make ", "python", "ros2 ", "rosdep ", "colcon ", "docker "),
    *("sudo ", ". install"),
)
"""A line or a piece of code that begins so is a command."""


def is_command(text):
    """Whether a line or a piece of code begins with a program, behind variables for it."""
    return re.sub(f"^({VARIABLE})+", "", text).startswith(PROGRAMS)


def commands(page):
    """Return the commands of a page in their order: from code blocks, tables and text.

    ``ankle`` stands for ``.venv/bin/ankle``. What a line says behind a hash is a remark, in which
    ``or: ...`` is another command. A piece of code with ``...`` is only a part of one.
    """
    found = []
    for line in page.read_text().splitlines():
        command, _, remark = line.strip().partition(" #")
        if re.match(r" {4,}|[A-Za-z.]", line) and is_command(command) and "`" not in command:
            found += [command.strip(), *re.findall(r"\bor: (.*)$", remark)]
            line = remark
        found += [part for part in re.findall(r"`([^`]+)`", line) if is_command(part)]
    found = [line.removesuffix(".") for line in found if "..." not in line]
    return [f".venv/bin/{line}" if line.startswith("ankle ") else line for line in found]


def words_of(line):
    """Return the words of a command, from its program on."""
    return shlex.split(re.sub(f"^({VARIABLE})+", "", line))
