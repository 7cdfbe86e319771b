"""The Chromium or Chrome of this system, for screenshots, tests and measurements."""

from __future__ import annotations

import shutil

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
ARGUMENTS = ("--no-sandbox",)
"""Arguments of the browser: Chromium refuses to start as root with its sandbox, and shows nothing
but our own pages here."""
NO_BROWSER = "no Chromium on this machine (on Debian or Ubuntu: sudo apt-get install chromium)"


def find_browser() -> str | None:
    """Return the path of the browser's executable; None where there is none."""
    return next((found for name in NAMES if (found := shutil.which(name))), None)
