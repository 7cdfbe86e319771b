"""The parallel cascade on a simulated joint whose plate stands at an angle: the second opinion must
not depend on how many samples a second there are.
"""

import numpy as np
import pytest
from random_motion import CORE, random_motion

from ankle_physics.model import Model
from ankle_physics.signals import Signals
from impedance_estimator.offline.parallel_cascade import parallel_cascade

FINEST = 2048.0  # Hz
MEAN_ANGLE = 0.3  # rad


@pytest.mark.parametrize("every", [1, 2, 4])
def test_stiffness_and_gain_are_the_same_at_any_sampling_rate(every):
    x, v, a = random_motion(FINEST, 60.0)
    torque = Model.of(CORE).torque(Signals(FINEST, x, v, a))
    position = x + MEAN_ANGLE
    found = parallel_cascade(FINEST / every, position[::every], torque[::every])
    assert found.gain == pytest.approx(10.0, rel=0.08)
    assert found.stiffness == pytest.approx(100.0, rel=0.08)
    assert found.vaf > 99.0
    assert np.isfinite(found.intrinsic).all()
