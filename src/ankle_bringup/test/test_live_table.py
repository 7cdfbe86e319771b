"""A table that is looked at ends with its last line, in a file too."""

import io

import pytest
from rich.console import Console
from rich.table import Table

from ankle_bringup.live_watch import live_table


def table(value):
    made = Table()
    made.add_column("K")
    made.add_row(value)
    return made


@pytest.mark.parametrize("terminal", [False, True])
def test_what_comes_next_begins_on_a_line_of_its_own(terminal):
    text = io.StringIO()
    console = Console(file=text, width=40, force_terminal=terminal)
    with live_table(table("50"), console) as live:
        live.update(table("60"))
    console.print("next")
    lines = text.getvalue().splitlines()
    assert any("60" in line for line in lines)
    assert lines[-1].endswith("next")
    assert "\u2518" not in lines[-1]
    # No empty line in a terminal, whose table is closed.
    assert lines[-2].strip()
