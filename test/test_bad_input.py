"""A small share of `make bad-input`: no kind of input does anything but work or be refused."""

import pytest
from bad_input import KINDS, Kind, examine

CASES = {"packets to the rig": 300, "packets to the driver": 200, "HTTP headers": 300}


@pytest.mark.parametrize("kind", KINDS)
def test_bad_input_is_used_or_refused(kind):
    found = examine(kind, CASES.get(kind.name, 12), 7, lambda index: None)
    assert not found.problems


def test_another_exception_is_neither_use_nor_refusal():
    def prepare(folder):
        def case(random):
            raise KeyError("no reader's error")

        return case

    found = examine(Kind("broken", 0.0, prepare), 3, 7, lambda index: None)
    assert found.counts == {"failed": 3}
    assert "broken 2: KeyError" in found.problems[2]
