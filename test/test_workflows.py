"""The workflows run each kind of test: on every push the short ones, every night all of them."""

import re

import pytest
import yaml
from documented_commands import ROOT

GITHUB = ".github/workflows/ci.yml"
GITLAB = ".gitlab-ci.yml"
TRIGGERS = True
"""YAML 1.1 reads the key ``on`` so."""


def lines_of(job):
    """Return the shell lines of a job of either kind of workflow."""
    return [*job.get("script", []), *(step.get("run", "") for step in job.get("steps", []))]


@pytest.mark.parametrize("file", [GITHUB, GITLAB])
def test_a_job_of_every_night_runs_the_slow_tests_and_all_packages_through_colcon(file):
    content = yaml.safe_load((ROOT / file).read_text())
    night = content.get("jobs", content)["nightly"]
    assert {"make test-slow", "make test-colcon"} <= set(lines_of(night))
    assert "schedule" in str(night.get("if", night.get("rules")))
    if file == GITHUB:
        assert re.fullmatch(r"\d+ \d+ \* \* \*", content[TRIGGERS]["schedule"][0]["cron"])


@pytest.mark.parametrize("file", [GITHUB, GITLAB])
def test_a_workflow_runs_only_targets_that_exist(file):
    content = yaml.safe_load((ROOT / file).read_text())
    jobs = [job for job in content.get("jobs", content).values() if isinstance(job, dict)]
    run = {line for job in jobs for line in lines_of(job) if line.startswith("make ")}
    rules = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.M)
    assert run
    assert {line.split()[1] for line in run} <= set(rules)
