"""Every effect changes the torque, and vanishes with its strength."""

import numpy as np
import pytest

from second_rig.draw import COUNTS, Case
from second_rig.effects.register import EFFECTS, ONLY_IN_PAIRS, PAIRS, SINGLE, UNLISTED
from second_rig.laboratory import draw_laboratory, simulated
from second_rig.sampling import LEAD_S, Clock
from second_rig.strength import draw_wanted, found_strengths, share

CLOCK = Clock(1000, 6.0)
# Compliance of a fixation that moves no foot, and is not too stiff for the steps of the engine.
NO_COMPLIANCE = 1e-6
# Behind a play is a contact that is as stiff with no play.
LEFT_OF_A_PLAY = 0.1


def _laboratory(name, seed=5):
    case = Case(
        "effect", 0, seed, (name,), "random pulses and steps", 1000, "leaky random walk",
        True, False, None,
    )  # fmt: skip
    generator = np.random.default_rng(seed)
    laboratory = draw_laboratory(case, case.protocol, CLOCK, generator)
    return laboratory, EFFECTS[name](generator, laboratory.subject, CLOCK.time)


def _share(laboratory, change):
    plain = simulated(laboratory, []).torque
    return share(CLOCK.sampled(simulated(laboratory, [change]).torque), CLOCK.sampled(plain))


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_changes_the_torque_and_vanishes_with_its_strength(name):
    laboratory, effect = _laboratory(name)
    assert effect.weakest < effect.start < effect.strongest
    strong = _share(laboratory, effect.change(effect.strongest))
    # A drift of 90 s hardly shows in these seconds.
    assert strong > 1e-5
    nothing = NO_COMPLIANCE if name in ("strap", "pad") else 1e-6 * effect.weakest
    left = LEFT_OF_A_PLAY if name == "backlash" else 1e-4
    assert _share(laboratory, effect.change(nothing)) < left * strong


def test_every_effect_is_hidden_in_some_recording():
    in_pairs = {name for pair in PAIRS for name in pair}
    assert set(EFFECTS) == set(SINGLE) | set(UNLISTED) | in_pairs
    assert in_pairs >= ONLY_IN_PAIRS
    assert (len(SINGLE), len(PAIRS), len(UNLISTED)) == (
        COUNTS["effect"], COUNTS["pair"], COUNTS["unlisted"],
    )  # fmt: skip


def test_an_effect_is_brought_to_the_share_that_is_wanted():
    laboratory, effect = _laboratory("friction")
    (wanted,) = draw_wanted(1, np.random.default_rng(1))
    (strength,), (reached,) = found_strengths(
        laboratory, np.zeros(CLOCK.samples), [effect], [wanted]
    )
    assert reached == pytest.approx(wanted, rel=0.17)
    assert _share(laboratory, effect.change(strength)) == pytest.approx(reached)


def test_factors_in_time_are_stated_from_the_start_of_the_recording():
    laboratory, effect = _laboratory("stiffness_drift")
    factor = effect.change(0.5).stiffness
    assert factor.shape == laboratory.reference.shape
    assert factor[CLOCK.middle] == pytest.approx(1.0, abs=1e-4)
    assert np.ptp(factor[CLOCK.first :]) == pytest.approx(0.5)
    # Nothing drifts before the recording begins.
    assert np.ptp(factor[: round(LEAD_S * CLOCK.fast_rate)]) == pytest.approx(0.0, abs=1e-9)
