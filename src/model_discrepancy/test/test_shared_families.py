"""One term takes the place of several of its family where it explains as much."""

import numpy as np
import pytest

from model_discrepancy.problem import prepare
from model_discrepancy.search.found import Effect, Found, Trial
from model_discrepancy.search.grids import Grids
from model_discrepancy.search.null import Null
from model_discrepancy.search.shared_families import unite
from simulation_study.planted_trials import simulate_trial

MODE = {"torque_sensor_mode": {"frequency": 45.0, "damping": 0.2}}
STRAPS = {"fixation_compliance": {"k_s": 900.0, "b_s": 3.0}}
RIGID = {"fixation_compliance": {"k_s": 40000.0, "b_s": 10.0}, "footplate_inertia": {"Ip": 0.003}}


@pytest.mark.parametrize(
    ("planted", "left"), [(STRAPS, [*STRAPS]), (MODE | STRAPS, [*MODE, *STRAPS])]
)
def test_straps_take_the_place_of_a_mode_and_rigid_straps_where_the_sensor_has_no_mode(
    planted, left
):
    problem = prepare(simulate_trial(planted, seed=4, duration=20.0, protocol="random"))
    fitter = problem.fitter
    null = Null.of(problem.noise, fitter.rows.time, fitter.rows.used)
    grids = Grids([*MODE, *STRAPS], 20.0)
    null.gains = {name: np.full(160, 0.002) for name in left}
    start = {**problem.base.values, **MODE, **RIGID}
    final = fitter.fit([*problem.base.terms, *MODE, *RIGID], start, evaluations=60)
    effects = [
        Effect(Trial(name, final, 0.5, (0.5, 0.5), -100.0), np.zeros(2))
        for name in (*MODE, *STRAPS)
    ]
    found = Found(problem.base, final, effects)
    united = unite(fitter, found, grids, null, fitter.rows.gain(), print)
    assert [effect.trial.name for effect in found.effects] == left
    assert united == (len(left) == 1)
    if united:
        assert found.final.score < 0.9 * final.score
        assert found.final.values["fixation_compliance"]["k_s"] == pytest.approx(900.0, rel=0.1)


def test_straps_take_the_place_of_a_part_that_swings_and_rigid_straps():
    """Both are of families of their own; what swings is the foot."""
    problem = prepare(simulate_trial(STRAPS, seed=4, duration=20.0, protocol="random"))
    fitter = problem.fitter
    null = Null.of(problem.noise, fitter.rows.time, fitter.rows.used)
    swings = {"plate_appendage": {"Ia": 0.012, "frequency": 45.0, "damping": 0.2}}
    null.gains = {name: np.full(160, 0.002) for name in (*swings, *STRAPS)}
    start = {**problem.base.values, **swings, **RIGID}
    final = fitter.fit([*problem.base.terms, *swings, *RIGID], start, evaluations=60)
    effects = [
        Effect(Trial(name, final, 0.5, (0.5, 0.5), -100.0), np.zeros(2))
        for name in (*swings, *STRAPS)
    ]
    found = Found(problem.base, final, effects)
    assert unite(fitter, found, Grids([*swings, *STRAPS], 20.0), null, fitter.rows.gain(), print)
    assert [effect.trial.name for effect in found.effects] == [*STRAPS]
    assert found.final.values["fixation_compliance"]["k_s"] == pytest.approx(900.0, rel=0.1)
