"""The browser of this system is found where it starts, and the same is said where there is none."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from biofeedback.web import system_browser
from biofeedback.web.system_browser import NAMES, NO_BROWSER, find_browser

ROOT = Path(__file__).parents[3]
PAGES = ("README.md", "docs/install.md")


@pytest.fixture
def only(tmp_path, monkeypatch):
    """Return a function that makes an executable; no other is on the path."""
    monkeypatch.setenv("PATH", str(tmp_path))

    def make(name, code):
        file = tmp_path / name
        file.write_text(f"#!{shutil.which('sh', path='/bin:/usr/bin')}\nexit {code}\n")
        file.chmod(0o755)
        return str(file)

    return make


def test_a_file_that_only_asks_for_a_snap_is_no_browser(only):
    only("chromium-browser", 1)
    assert find_browser() is None
    chrome = only("google-chrome", 0)
    assert find_browser() == chrome


def test_a_file_that_no_system_can_run_is_no_browser(only, tmp_path):
    file = tmp_path / "chromium"
    file.write_bytes(b"\x7fELF")
    file.chmod(0o755)
    assert find_browser() is None


def test_the_script_says_what_is_not_tested(only):
    words = [sys.executable, "-I", system_browser.__file__]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1
    assert NO_BROWSER in done.stdout
    only("chromium", 0)
    assert subprocess.run(words, timeout=60, check=False).returncode == 0


def test_the_pages_name_the_same_installations():
    installations = re.findall(r"sudo [a-z -]+", NO_BROWSER)
    assert len(installations) == 2
    for page in PAGES:
        text = (ROOT / page).read_text()
        assert [line for line in installations if f"`{line}`" not in text] == [], page
        assert "Google Chrome" in text


def test_the_names_of_executables_stand_in_one_place():
    for file in ("Makefile", ".ci/run"):
        words = re.findall(r"[\w-]+", (ROOT / file).read_text())
        assert not {*NAMES[1:]} & {*words}, file
