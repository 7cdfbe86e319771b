"""A search that has to end in time adds nothing more when its time is over."""

from types import SimpleNamespace

import pytest

from ankle_interfaces.errors import QuantityError
from model_discrepancy.diagnose import diagnose
from model_discrepancy.fit.parallel import in_parallel
from model_discrepancy.search import time_limit as module
from model_discrepancy.search.time_limit import time_is_over, time_limit
from simulation_study.planted_trials import simulate_trial


@pytest.fixture
def clock(monkeypatch):
    """Return a clock that stands at `now` [s]."""
    clock = SimpleNamespace(now=100.0)
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: clock.now))
    return clock


def test_time_is_over_after_the_minutes_that_were_asked_for_and_in_each_thread(clock):
    with time_limit(2.0) as limit:
        clock.now += 119.9
        assert in_parallel(lambda _: time_is_over(), range(4)) == [False] * 4
        assert not limit.left_something_out
        clock.now += 0.2
        assert in_parallel(lambda _: time_is_over(), range(4)) == [True] * 4
        assert limit.left_something_out
        assert "after 2 min" in limit.reason
    assert not time_is_over()


def test_without_a_limit_time_is_never_over(clock):
    with time_limit(None) as limit:
        clock.now += 1e9
        assert not time_is_over()
    assert limit is None


@pytest.mark.parametrize("minutes", [0.0, -1.0, 1000.0, float("nan")])
def test_a_time_out_of_range_is_refused(minutes):
    with pytest.raises(QuantityError, match=r"0\.5 to 120 min"), time_limit(minutes):
        pass


LIBRARY = ("short_range_stiffness", "torque_sensor_lag", "maxwell_relaxation", "reflex_threshold")


@pytest.fixture(scope="module")
def recording():
    effects = {"short_range_stiffness": {"k": 60.0}, "torque_sensor_lag": {"T": 0.004}}
    return simulate_trial(effects, seed=3, duration=30.0)


@pytest.fixture(scope="module")
def whole(recording):
    return diagnose(recording, library=LIBRARY)


def ended_while(recording, clock, term):
    """Diagnose; the time is over while this term is looked for."""

    def step(line):
        clock.now += 1e6 * line.startswith(f"looking for term {term}")

    return diagnose(recording, library=LIBRARY, progress=step, at_most=1.0)


def test_a_diagnosis_keeps_what_it_found_in_time_and_says_that_it_was_ended(
    recording, whole, clock
):
    assert len(whole.found.effects) == 2
    assert not [line for line in whole.verdict.reasons if "as asked" in line]
    short = ended_while(recording, clock, term=1)
    assert len(short.found.effects) == 1
    assert short.verdict.verdict == "unexplained"
    assert [line for line in short.verdict.reasons if "after 1 min, as asked" in line]


def test_what_needs_less_than_the_time_is_as_without_a_limit(recording, whole, clock):
    limited = ended_while(recording, clock, term=99)
    assert limited.verdict.effects == whole.verdict.effects
    assert limited.verdict.reasons == whole.verdict.reasons
