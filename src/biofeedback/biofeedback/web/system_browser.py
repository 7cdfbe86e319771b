"""Finds the Chromium or Chrome of this system, for screenshots, tests and measurements.

Run as a script it ends with 1 and says what to install where there is none; it needs no package.
"""

from __future__ import annotations

import shutil
import subprocess
import sys

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
ARGUMENTS = ("--no-sandbox",)
"""Arguments of the browser: Chromium refuses to start as root with its sandbox, and shows nothing
but our own pages here."""
NO_BROWSER = (
    "no Chromium or Chrome starts on this machine (Debian: sudo apt-get install chromium; "
    "Ubuntu: sudo snap install chromium, or Google Chrome's package)"
)
VERSION_TIME = 20.0
"""[s] For the answer to ``--version`` on a busy computer; alone it takes 0.2 s."""


def starts(path: str) -> bool:
    """Tell whether a browser answers; a file of its name on Ubuntu may only ask for a snap."""
    try:
        done = subprocess.run(
            [path, "--version"], capture_output=True, timeout=VERSION_TIME, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0


def find_browser() -> str | None:
    """Return the path of a browser's executable that starts; None where there is none."""
    paths = (found for name in NAMES if (found := shutil.which(name)))
    return next((path for path in paths if starts(path)), None)


if __name__ == "__main__":
    if find_browser() is None:
        print(f"NOT TESTED: the pages in a browser, because {NO_BROWSER}")
        sys.exit(1)
