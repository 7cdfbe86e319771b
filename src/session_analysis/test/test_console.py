"""What `ankle validate` shows in a terminal."""

import io

from rich.console import Console

from session_analysis.console import correlation_table


def test_the_brackets_of_an_interval_are_shown_as_they_are():
    head, row = ("muscle", "r [95 % interval]"), ("SOL", "0.92 [0.88, 0.95]")
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(correlation_table([head, row]))
    shown = console.export_text()
    assert "r [95 % interval]" in shown
    assert "0.92 [0.88, 0.95]" in shown
    assert "\\" not in shown
