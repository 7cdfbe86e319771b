"""Terms of one's own from a folder; in a process of its own, since a library only grows."""

import subprocess
import sys
from pathlib import Path

TERM = '''
from ankle_physics.term import Parameter, Place, Term


class Cable(Term):
    """A cable: torque = c * x^5."""

    name = "{name}"
    place = Place.INTRINSIC
    sentence = "A cable pulls."
    parameters = (Parameter("c", "N.m/rad^5", 0.0, 1e9, 2e3, "measured", linear=True),)

    def torque(self, signals, values, state):
        return {{"c": signals.foot_position**5}}
'''
SCRIPT = """
import sys
import numpy as np
from ankle_physics.model import Model
from ankle_physics.own_terms import load_terms
from ankle_physics.signals import Signals
from ankle_physics.term import term_library
for folder in sys.argv[1:]:
    try:
        print(load_terms(folder), load_terms(folder))
    except ValueError as error:
        print("refused:", error)
print("stiffness is", term_library()["stiffness"].__module__)
try:
    model = Model.from_content({"terms": [{"term": "own_cable", "c[N.m/rad^5]": 10.0}]})
    still = np.zeros(3)
    print(model.torque(Signals(1000.0, still + 2.0, still, still)))
except ValueError as error:
    print("refused:", error)
"""
REFUSED_FILES = {
    TERM.format(name="stiffness"): "'stiffness' is taken by ankle_physics.terms.stiffness",
    TERM.format(name="Own Cable"): "'Own Cable' is not like",
    TERM.format(name="own_cable").replace("sentence =", "phrase ="): "state 'sentence'",
    "import nowhere_at_all": "cannot be run: ModuleNotFoundError",
    "x = 1": "holds no term",
}


def run(*folders: Path) -> list[str]:
    """Lines that a process says which loads these folders and then uses the term."""
    return subprocess.run(
        [sys.executable, "-c", SCRIPT, *map(str, folders)],
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    ).stdout.splitlines()


def test_a_model_may_hold_a_term_of_ones_own(tmp_path):
    (tmp_path / "cable.py").write_text(TERM.format(name="own_cable"))
    said = run(tmp_path)
    assert said[0] == "('own_cable',) ('own_cable',)"
    assert said[-1] == "[320. 320. 320.]"


def test_folders_that_cannot_be_used_are_refused_and_add_nothing(tmp_path):
    folders = [tmp_path / str(number) for number in range(len(REFUSED_FILES))]
    for folder, text in zip(folders, REFUSED_FILES, strict=True):
        folder.mkdir()
        (folder / "cable.py").write_text(text)
    *said, base, own = run(*folders)
    for line, words in zip(said, REFUSED_FILES.values(), strict=True):
        assert line.startswith("refused:")
        assert words in line
    assert base == "stiffness is ankle_physics.terms.stiffness"
    assert "unknown term 'own_cable'" in own
