"""The seal cannot be opened, changed or exchanged unnoticed, and the diagnosis cannot look behind
it.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from simulation_study.blind import concealment
from simulation_study.blind.seal import KEY_FILE, Seal, SealError, canonical, commitment, root

TRUTH = {"case": "case_000", "kind": "known", "effects": [{"name": "maxwell", "share": 0.0213}]}


def test_opens_to_what_was_sealed(tmp_path: Path) -> None:
    seal = Seal(tmp_path / "truth", store_key=True)
    committed = seal.close("case_000", TRUTH)
    salt, truth = Seal(tmp_path / "truth", store_key=True).open("case_000", committed)
    assert truth == TRUTH
    assert commitment(salt, truth) == committed
    assert seal.sealed() == {"case_000": committed}


def test_nothing_of_the_truth_is_readable(tmp_path: Path) -> None:
    Seal(tmp_path / "truth", store_key=False).close("case_000", TRUTH)
    content = b"".join(file.read_bytes() for file in (tmp_path / "truth").iterdir())
    assert b"maxwell" not in content
    assert not (tmp_path / "truth" / KEY_FILE).exists()


def test_without_the_key_nobody_goes_on(tmp_path: Path) -> None:
    Seal(tmp_path / "truth", store_key=False).close("case_000", TRUTH)
    with pytest.raises(SealError, match="key is gone"):
        Seal(tmp_path / "truth", store_key=True)


def test_a_changed_truth_does_not_open(tmp_path: Path) -> None:
    seal = Seal(tmp_path / "truth", store_key=True)
    committed = seal.close("case_000", TRUTH)
    file = tmp_path / "truth" / "case_000.sealed"
    content = bytearray(file.read_bytes())
    content[40] = ord("A") if content[40] != ord("A") else ord("B")
    file.write_bytes(bytes(content))
    with pytest.raises(SealError, match="changed"):
        seal.open("case_000", committed)


def test_an_exchanged_truth_does_not_open_even_for_the_holder_of_the_key(tmp_path: Path) -> None:
    seal = Seal(tmp_path / "truth", store_key=True)
    committed = seal.close("case_000", TRUTH)
    (tmp_path / "truth" / "case_000.sealed").unlink()
    with pytest.raises(SealError, match="missing"):
        seal.open("case_000", committed)
    other = seal.close("case_000", {**TRUTH, "kind": "null"})
    with pytest.raises(SealError, match="announced"):
        seal.open("case_000", committed)
    assert root({"case_000": committed}) != root({"case_000": other})


def test_equal_truths_have_different_commitments(tmp_path: Path) -> None:
    seal = Seal(tmp_path / "truth", store_key=False)
    assert seal.close("case_000", TRUTH) != seal.close("case_001", TRUTH)
    with pytest.raises(SealError, match="already"):
        seal.close("case_000", TRUTH)


def test_canonical_form_does_not_depend_on_the_order_of_keys() -> None:
    assert canonical({"a": 1, "b": [0.1, 2]}) == canonical({"b": [0.1, 2], "a": 1})
    with pytest.raises(ValueError, match="JSON"):
        canonical({"a": float("nan")})


needs_landlock = pytest.mark.skipif(
    not concealment.interface_version(), reason="this kernel has no Landlock"
)


def _python(hidden: list[Path], script: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = concealment.concealed([sys.executable, "-c", script, *arguments], hidden)
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


@needs_landlock
def test_concealed_process_reads_everything_but_the_hidden(tmp_path: Path) -> None:
    hidden, open_ = tmp_path / "a" / "truth", tmp_path / "a" / "bags"
    for folder in (hidden, open_):
        folder.mkdir(parents=True)
        (folder / "file").write_text("content")
    read = "import sys; print(open(sys.argv[1]).read())"
    assert _python([hidden], read, str(open_ / "file")).stdout == "content\n"
    for attempt in (
        read,
        "import os, sys; os.listdir(os.path.dirname(sys.argv[1]))",
        "import os, sys; os.remove(sys.argv[1])",
    ):
        done = _python([hidden], attempt, str(hidden / "file"))
        assert done.returncode != 0
        assert "PermissionError" in done.stderr
    (open_ / "link").symlink_to(hidden / "file")
    assert "PermissionError" in _python([hidden], read, str(open_ / "link")).stderr
    write = "import sys; open(sys.argv[1], 'w').write('new')"
    assert _python([hidden], write, str(open_ / "new")).returncode == 0
    assert (hidden / "file").read_text() == "content"


@needs_landlock
def test_children_of_a_concealed_process_are_concealed_and_cannot_look_into_the_parent(
    tmp_path: Path,
) -> None:
    hidden = tmp_path / "truth"
    hidden.mkdir()
    (hidden / "file").write_text("content")
    nested = "import subprocess, sys; sys.exit(subprocess.run(['cat', sys.argv[1]]).returncode)"
    done = _python([hidden], nested, str(hidden / "file"))
    assert done.returncode != 0
    assert "content" not in done.stdout
    memory = "import sys; open(f'/proc/{sys.argv[1]}/mem', 'rb')"
    assert "PermissionError" in _python([hidden], memory, str(os.getpid())).stderr


@needs_landlock
def test_the_try_out_tells_hidden_from_visible(tmp_path: Path) -> None:
    (tmp_path / "truth").mkdir()
    assert concealment.works([tmp_path / "truth", Path(concealment.__file__).parent])


def test_without_landlock_the_launcher_refuses_to_run_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(concealment, "interface_version", lambda: 0)
    with pytest.raises(concealment.ConcealmentError, match="no Landlock"):
        concealment.conceal([tmp_path])
