"""The table of mutants names controls that are there."""

import importlib.util
from pathlib import Path

_SPEC = importlib.util.spec_from_file_location(
    "ankle_mutants", Path(__file__).with_name("mutants.py")
)
mutants = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(mutants)


def test_every_mutant_removes_one_control_that_is_there():
    for mutant in mutants.MUTANTS:
        assert mutants.broken(mutant, mutants.ROOT) != (mutants.ROOT / mutant.file).read_text()
        assert (mutants.ROOT / mutants.TESTS / mutant.killer.partition(":")[0]).exists()
    assert len({mutant.name for mutant in mutants.MUTANTS}) == len(mutants.MUTANTS) >= 40
