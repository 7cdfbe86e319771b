"""A bag goes through the stages of a diagnosis in one direction, also one that is not explained.

The stages are the folders recording, fit, search, criticism and report; `problem`, which makes a
recording ready for the search, belongs to the fit. The way to a verdict is the sequence of stages
that `diagnose` and `problem` call, properties of their results included. A return is a call into
another stage than the one before, which stands before the last stage that was reached.
"""

import ast
import json
import re
import sys
import threading
from html import escape
from pathlib import Path

import pytest

import model_discrepancy
from ankle_physics.model import Model
from model_discrepancy.criticism import criticism
from model_discrepancy.criticism.criticism import criticise
from model_discrepancy.diagnose import diagnose
from model_discrepancy.report.result_folder import write_results
from model_discrepancy.search.term_search import search
from model_discrepancy.tools.resimulation import resimulate
from simulation_study.planted_trials import simulate_trial

ROOT = Path(model_discrepancy.__file__).parent
STAGES = ("recording", "fit", "search", "criticism", "report")
MOST_RETURNS = 8


def stage_of(module):
    """Return the number of a module's stage; None for what belongs to none."""
    name = module.removeprefix("model_discrepancy.").split(".")[0]
    name = "fit" if name == "problem" else name
    return STAGES.index(name) if name in STAGES else None


def imported(path):
    """Return the modules that a file imports when it is run, not those for type checks alone."""
    nodes = [ast.parse(path.read_text())]
    while nodes:
        node = nodes.pop()
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            continue
        if isinstance(node, ast.ImportFrom):
            yield node.module
        nodes += ast.iter_child_nodes(node)


@pytest.mark.parametrize("stage", STAGES)
def test_no_stage_knows_a_later_one(stage):
    files = [*(ROOT / stage).glob("*.py"), *([ROOT / "problem.py"] if stage == "fit" else [])]
    later = [
        f"{path.name} imports {module}"
        for path in files
        for module in imported(path)
        if module.startswith("model_discrepancy.")
        and stage_of(module) is not None
        and stage_of(module) > STAGES.index(stage)
    ]
    assert len(files) > 1
    assert not later


def returns(stages):
    """Count the returns on a way through stages, given by their numbers."""
    found = [b for a, b in zip([None, *stages], stages, strict=False) if a != b]
    return sum(stage < max(found[:place], default=0) for place, stage in enumerate(found))


def test_returns_are_counted():
    assert returns([0, 0, 1, 2, 2, 3, 4]) == 0
    assert returns([0, 1, 0, 1, 2, 1, 1, 3]) == 2


@pytest.fixture(scope="module")
def unexplained(tmp_path_factory):
    """Diagnose a recording whose effect the library lacks.

    Gives the recording, the folder of the diagnosis and its way through the stages.
    """
    effect = {"torque_sensor_mode": {"frequency": 25.0, "damping": 0.15}}
    recording = simulate_trial(effect, seed=6, duration=40.0)
    library = [
        "reflex_threshold",
        "position_dependent_stiffness",
        "thixotropy",
        "hardening_stiffness",
    ]
    folder, way = tmp_path_factory.mktemp("unexplained"), []

    def note(frame, event, _):
        if event != "call" or frame.f_back is None:
            return
        caller = frame.f_back.f_globals.get("__name__", "")
        if caller in ("model_discrepancy.diagnose", "model_discrepancy.problem"):
            callee = frame.f_globals.get("__name__", "")
            stage = stage_of(callee) if callee.startswith("model_discrepancy.") else None
            if stage is not None and callee != "model_discrepancy.problem":
                way.append(stage)

    def watch(noting):
        """Watch this thread and those that it starts: a diagnosis runs in one of its own."""
        threading.setprofile(noting)
        sys.setprofile(noting)

    def unwatched(function):
        """Note that a stage is called, and run it at full speed: what it calls does not count."""

        def run(*arguments):
            watch(None)
            way.append(stage_of(function.__module__))
            try:
                return function(*arguments)
            finally:
                watch(note)

        return run

    with pytest.MonkeyPatch.context() as patch:
        for function in (search, criticise, write_results):
            patch.setattr(sys.modules[diagnose.__module__], function.__name__, unwatched(function))
        watch(note)
        try:
            verdict = diagnose(recording, folder, library=library).verdict
        finally:
            watch(None)
    assert verdict.verdict == "unexplained"
    return recording, folder, way


def test_a_term_that_the_library_lacks_is_not_given_a_confident_wrong_name(
    unexplained, undocumented_keys
):
    recording, folder, _ = unexplained
    content = json.loads((folder / "verdict.json").read_text())
    assert undocumented_keys(content) == set()
    assert undocumented_keys({"rig": {"of_nobody[1]": 1.0}}) == {"of_nobody"}
    block = content["localisation"]["missing_block"]
    assert block["share_predicted"] > 0.3
    assert len(block["dynamics"]["lag[s]"]) == len(block["dynamics"]["low[N.m/s]"])
    again = resimulate(
        recording, Model.load(folder / "base.yaml"), Model.load(folder / "model.yaml")
    )
    assert Model.load(folder / "model.yaml").has("missing_block")
    assert again.vaf["augmented"] > again.vaf["base"] + 0.2
    report = (folder / "report.html").read_text()
    assert "The missing block" in report
    assert "What to measure next" in report
    assert report.count(escape(block["sentence"])) == 1
    assert not re.search(r"<td>[^<]*(_|\[1\]|\[s\])", report)


def test_a_bag_is_on_its_way_to_the_verdict_without_turning_back(unexplained):
    _, _, way = unexplained
    assert set(way) == set(range(len(STAGES)))
    assert returns(way) <= MOST_RETURNS


def test_names_that_explain_next_to_nothing_are_in_no_model(tmp_path, monkeypatch):
    """Where they are no mismatch, K and G are those of the base model, as well known as in it."""
    monkeypatch.setattr(criticism, "judge", lambda *_: ("no_mismatch", float("nan")))
    recording = simulate_trial({"fixation_compliance": {}}, seed=6, duration=40.0)
    found = diagnose(recording, tmp_path, library=["fixation_compliance"])
    assert [effect.trial.name for effect in found.found.effects] == ["fixation_compliance"]
    assert found.verdict.effects == []
    assert any(
        "fixation_compliance would improve the fit" in reason for reason in found.verdict.reasons
    )
    for key in ("K[N.m/rad]", "G[N.m.s/rad]"):
        of_base = found.verdict.parameters[key]
        assert of_base["augmented"] == of_base["base"]
        assert of_base["standard_error"] < 0.1 * of_base["base"]
    fit = found.verdict.fit
    assert fit["augmented_vaf_holdout"] == fit["baseline_vaf_holdout"]
    assert fit["remaining_predictable_share"] == round(found.criticism.before.share, 4) > 0.0
    model = Model.load(tmp_path / "model.yaml")
    assert "fixation_compliance" not in [entry.term.name for entry in model.entries]
    report = (tmp_path / "report.html").read_text()
    assert "The base model's parameters" in report
    for claim in ("with the new physics", "with all that was found", "with what was found"):
        assert claim not in report
