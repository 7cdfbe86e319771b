"""A sensor is described as far as the recording shows one."""

import pytest

from calibration.fitted_value import Found
from calibration.plate_fit import _is_seen


@pytest.mark.parametrize(
    ("shape", "seen"),
    [
        ({"delay": 0.0007}, True),
        ({"delay": 0.0, "lag": 0.003}, True),
        ({"delay": 0.0, "lag": 0.00012}, False),  # a part of the delay
        ({"delay": 0.0, "mode": 62.0, "mode_damping": 0.06}, True),
        ({"delay": 0.0, "mode": 290.0, "mode_damping": 0.06}, False),
        ({"delay": 0.0, "mode": 62.0, "mode_damping": 0.6}, False),  # friction looks alike
    ],
)
def test_a_shape_at_the_end_of_its_range_is_a_part_of_the_delay(shape, seen):
    assert _is_seen({name: Found(value, 1e-5) for name, value in shape.items()}) is seen
