"""A whole study with a stand-in for the diagnosis: sealed, concealed, resumed, scored."""

import io
import json
import sys
from pathlib import Path

import pytest
from rich.console import Console

from blind_rig.cases import plan_cases
from simulation_study.blind import concealment, study
from simulation_study.blind.seal import SealError
from simulation_study.study_folder import StudyError

# Says no_mismatch whatever it is given, counts its runs beside the bags, and reports whether it saw
# what it must not see.
STAND_IN = """
import json, os, sys
bag, out, counter, *secrets = sys.argv[1:]
assert os.path.exists(os.path.join(bag, "metadata.yaml"))
def seen(path):
    try:
        os.listdir(path)
    except PermissionError:
        return False
    return True
os.makedirs(out)
with open(counter, "a") as file:
    file.write(os.path.basename(bag) + "\\n")
with open(os.path.join(out, "verdict.json"), "w") as file:
    json.dump({"verdict": "no_mismatch", "effects": [], "saw": [seen(p) for p in secrets]}, file)
"""


@pytest.fixture
def laboratory(tmp_path: Path) -> dict[str, Path]:
    tools = tmp_path / "tools"
    tools.mkdir()
    (tools / "stand_in.py").write_text(STAND_IN)
    return {
        "out": tmp_path / "study",
        "truth": tmp_path / "study_truth",
        "script": tools / "stand_in.py",
        "counter": tools / "count",
    }


def _command(laboratory: dict[str, Path]) -> list[str]:
    secrets = [str(laboratory["truth"]), str(Path(study.__file__).parent)]
    return [
        sys.executable,
        str(laboratory["script"]),
        "{bag}",
        "{out}",
        str(laboratory["counter"]),
        *secrets,
    ]


def _quick_plans(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cases that need no search for a strength."""
    plans = [p for seed in range(3) for p in plan_cases(40, seed) if p.kind in ("null", "broken")]
    monkeypatch.setattr(
        study,
        "plan_cases",
        lambda n, seed: [p._replace(name=f"case_{k:03d}") for k, p in enumerate(plans[:n])],
    )


@pytest.mark.slow
def test_study_from_seal_to_score_and_nothing_done_twice(
    laboratory: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    _quick_plans(monkeypatch)
    printed = io.StringIO()
    console = Console(file=printed, width=300)
    result = study.blind(2, 1, laboratory["out"], _command(laboratory), workers=1, console=console)
    text = printed.getvalue()
    published = json.loads((laboratory["out"] / "commitments.json").read_text())
    assert published["root"] == result["root"]
    assert text.index(result["root"]) < text.index("Opened")
    assert sorted(laboratory["counter"].read_text().split()) == ["case_000", "case_001"]
    page = (laboratory["out"] / "result.md").read_text()
    assert result["root"] in page
    assert (laboratory["out"] / "confusion.png").stat().st_size > 1000
    content = json.loads((laboratory["out"] / "result.json").read_text())
    for case in content["cases"]:
        assert case["verdict"] == "no_mismatch"
        assert case["outcome"] == ("right" if case["kind"] == "null" else "no_mismatch")
    if concealment.interface_version():
        verdict = json.loads(
            (laboratory["out"] / "verdicts" / "case_000" / "diagnosis" / "verdict.json").read_text()
        )
        assert verdict["saw"] == [False, False]
        assert result["concealed_by"] == "landlock"

        # A case whose diagnosis was interrupted is diagnosed again, the others are not, and no bag
        # is made anew.
        (laboratory["out"] / "verdicts" / "case_001" / "run.json").unlink()
        bags = {
            file: file.stat().st_mtime_ns for file in (laboratory["out"] / "bags").rglob("*.mcap")
        }
        again = study.blind(
            2, 1, laboratory["out"], _command(laboratory), workers=1, console=console
        )
        assert again["root"] == result["root"]
        assert laboratory["counter"].read_text().split()[2:] == ["case_001"]
        assert bags == {
            file: file.stat().st_mtime_ns for file in (laboratory["out"] / "bags").rglob("*.mcap")
        }

        with pytest.raises(StudyError, match="seed 1 instead of 2"):
            study.blind(2, 2, laboratory["out"], _command(laboratory), console=console)
        bag = next(iter(bags))
        bag.write_bytes(bag.read_bytes() + b"\0")
        with pytest.raises(SealError, match="was changed after it was sealed"):
            study.blind(2, 1, laboratory["out"], _command(laboratory), console=console)


def test_refusals(laboratory: dict[str, Path], tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="must lie apart"):
        study.blind(
            2, 1, laboratory["out"], _command(laboratory), truth=laboratory["out"] / "truth"
        )
    with pytest.raises(StudyError, match="must say"):
        study.blind(2, 1, laboratory["out"], ["diagnose"])
    with pytest.raises(StudyError, match="not a study"):
        study.blind(2, 1, tmp_path, _command(laboratory))


def test_a_diagnosis_that_fails_or_hangs_is_no_verdict(
    laboratory: dict[str, Path], tmp_path: Path
) -> None:
    from simulation_study.blind.diagnosis import diagnose_case, read_verdict

    bag = tmp_path / "bag"
    bag.mkdir()
    failed = diagnose_case(
        [sys.executable, "-c", "import sys; sys.exit(3)", "{bag}", "{out}"],
        bag,
        tmp_path / "failed",
        [],
        30.0,
    )
    assert failed["exit"] == 3
    assert read_verdict(tmp_path / "failed") == (None, None)
    hung = diagnose_case(
        [sys.executable, "-c", "import time; time.sleep(60)"], bag, tmp_path / "hung", [], 1.0
    )
    assert hung["exit"] is None
    assert hung["seconds"] < 20
