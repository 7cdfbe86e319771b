"""The strength of an effect is what the paper's model cannot absorb of it, and nothing else."""

import numpy as np
import pytest

from blind_rig import effects, strength
from blind_rig.protocols import Protocol
from blind_rig.subjects import draw_subject
from blind_rig.trial import Trial


def _trial(variation: float) -> Trial:
    setup = draw_subject(np.random.default_rng(3)).replaced(
        {"courses.stretch_variation": variation}
    )
    return Trial(setup, Protocol("pulse_step", 0.04, 0.024, 20.0), 1000.0, 0.1, 8)


@pytest.mark.slow
def test_a_reflex_that_varies_adds_nothing_to_the_strength_of_an_effect():
    effect = effects.EFFECTS_BY_NAME["reflex_position"]
    shape, limits = effects.draw_shape(effect, np.random.default_rng(1))
    alike, varying = (
        strength.scale(_trial(variation), effect, shape, limits, 0.02) for variation in (0.0, 0.3)
    )
    assert varying.share == alike.share
    assert varying.changes == alike.changes
