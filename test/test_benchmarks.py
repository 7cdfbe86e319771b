"""Every benchmark can be started; those that need no rig and no browser run at a small size."""

import importlib.util
import subprocess
import sys

import pytest
from documented_commands import ROOT

PROGRAMS = sorted(
    path for path in (ROOT / "benchmarks").glob("*.py") if "__main__" in path.read_text()
)
"""The others are what several of them use, or what one compares with."""
PEERS = {"naming": "pysindy"}
"""What a benchmark compares with and `requirements/bench.txt` alone installs."""
SMALL_ARGUMENTS = {
    "offline": ("--seconds", "45"),
    "simulation": (),
    "estimators": (),
    "interval_coverage": ("--trials", "4", "--resamples", "49"),
    "discrepancy_fit": (),
}
"""Those that only compute, with options that keep them short."""


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_every_benchmark_finds_what_it_imports_and_says_what_it_measures(path, monkeypatch):
    if path.stem in PEERS:
        pytest.importorskip(PEERS[path.stem])
    monkeypatch.syspath_prepend(path.parent)
    spec = importlib.util.spec_from_file_location(f"benchmark_{path.stem}", path)
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, module)
    spec.loader.exec_module(module)
    assert callable(module.main)
    assert len(module.__doc__.split()) > 5


def test_every_benchmark_is_documented():
    pages = "".join(path.read_text() for path in (ROOT / "docs").rglob("*.md"))
    makefile = (ROOT / "Makefile").read_text()
    assert [path.name for path in PROGRAMS if path.name not in pages + makefile] == []


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", SMALL_ARGUMENTS)
def test_a_benchmark_that_only_computes_runs(name, tmp_path):
    done = subprocess.run(
        [sys.executable, ROOT / "benchmarks" / f"{name}.py", *SMALL_ARGUMENTS[name]],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=800,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
