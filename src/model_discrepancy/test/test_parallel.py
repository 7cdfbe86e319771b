"""Fits side by side give what they give one after the other."""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from ankle_physics.joint_profile import PROFILES, joint_in_force
from model_discrepancy.fit import parallel
from model_discrepancy.fit.parallel import (
    NICENESS,
    SWITCH_INTERVAL,
    in_background,
    in_parallel,
    side_by_side,
)
from model_discrepancy.fit.recent_results import RecentResults


@pytest.fixture
def two_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel, "cores", lambda: 2)


def test_results_keep_the_order_of_the_items(two_cores: None) -> None:
    def slow_at_first(item: int) -> int:
        time.sleep(0.05 if item == 0 else 0.0)
        return item

    assert in_parallel(slow_at_first, range(5)) == [0, 1, 2, 3, 4]
    assert in_parallel(slow_at_first, []) == []


def test_two_items_run_at_the_same_time(two_cores: None) -> None:
    meeting = threading.Barrier(2, timeout=10.0)
    in_parallel(lambda _: meeting.wait(), [0, 1])


def test_what_a_thread_does_starts_no_further_threads_while_no_core_is_idle(
    two_cores: None,
) -> None:
    meeting = threading.Barrier(2, timeout=10.0)

    def within(_: int) -> set[int]:
        meeting.wait()
        used = set(in_parallel(lambda _: threading.get_ident(), [0, 1]))
        meeting.wait()
        return used | {threading.get_ident()}

    assert [len(threads) for threads in in_parallel(within, [0, 1])] == [1, 1]


def test_a_core_that_has_become_idle_helps_what_is_left(two_cores: None) -> None:
    """The second item is done at once; the items within the first one then use both cores."""
    second_done = threading.Event()

    def within(item: int) -> None:
        if item == 1:
            second_done.set()
            return
        assert second_done.wait(10.0)
        time.sleep(0.1)
        meeting = threading.Barrier(2, timeout=10.0)
        in_parallel(lambda _: meeting.wait(), [0, 1])

    in_parallel(within, [0, 1])


def test_more_threads_than_cores_never_compute(two_cores: None) -> None:
    counting, running, most = threading.Lock(), [0], [0]

    def computes(_: int) -> None:
        with counting:
            running[0] += 1
            most[0] = max(most[0], running[0])
        time.sleep(0.002)
        with counting:
            running[0] -= 1

    in_parallel(lambda _: in_parallel(computes, range(5)), range(7))
    assert most[0] == 2


def test_an_error_in_a_thread_is_an_error_here(two_cores: None) -> None:
    def fails(item: int) -> int:
        if item == 1:
            raise ValueError("the second one")
        return item

    with pytest.raises(ValueError, match="the second one"):
        in_parallel(fails, [0, 1, 2])


def test_the_joint_profile_holds_in_all_threads(two_cores: None) -> None:
    with PROFILES["knee"].in_force():
        assert in_parallel(lambda _: joint_in_force(), [0, 1]) == [PROFILES["knee"]] * 2


def niceness() -> int:
    return os.getpriority(os.PRIO_PROCESS, threading.get_native_id())


def test_work_in_the_background_gives_way_and_the_caller_does_not(two_cores: None) -> None:
    own = niceness()
    found = in_background(lambda: [niceness(), *in_parallel(lambda _: niceness(), [0, 1])])
    assert found == [max(own, NICENESS)] * 3
    assert niceness() == own


def test_work_in_the_background_has_the_context_and_the_errors_of_the_caller() -> None:
    with PROFILES["knee"].in_force():
        assert in_background(joint_in_force) == PROFILES["knee"]

    def fails() -> None:
        raise ValueError("in the background")

    with pytest.raises(ValueError, match="in the background"):
        in_background(fails)


def test_the_latest_results_are_remembered() -> None:
    made: list[int] = []

    def result(key: int) -> int:
        return results.of(key, lambda: made.append(key) or 10 * key)

    results: RecentResults[int] = RecentResults(2)
    assert [result(key) for key in (1, 2, 1, 3, 1, 2)] == [10, 20, 10, 30, 10, 20]
    assert made == [1, 2, 3, 2]


def test_many_threads_may_ask_for_results() -> None:
    results: RecentResults[float] = RecentResults(3)
    generator = np.random.default_rng(0)
    asked = [generator.integers(0, 8, 2000).tolist() for _ in range(4)]
    wrong: list[int] = []

    def ask(keys: list[int]) -> None:
        wrong.extend(key for key in keys if results.of(key, lambda key=key: key + 0.5) != key + 0.5)

    threads = [threading.Thread(target=ask, args=(keys,)) for keys in asked]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_threads_side_by_side_do_not_wait_for_each_other_and_the_usual_way_comes_back() -> None:
    usual = sys.getswitchinterval()

    def inside() -> None:
        assert sys.getswitchinterval() == pytest.approx(SWITCH_INTERVAL)
        blas = [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]
        assert set(blas) == {1}
        raise ValueError("inside")

    with pytest.raises(ValueError, match="inside"), side_by_side():
        inside()
    assert sys.getswitchinterval() == usual


def test_an_interruption_that_another_thread_receives_ends_the_wait() -> None:
    """The system wakes only the thread that receives a signal."""
    interrupted = threading.Event()
    in_time: list[bool] = []

    def compute() -> None:
        time.sleep(0.3)  # The caller waits by then.
        signal.pthread_kill(threading.get_ident(), signal.SIGINT)
        in_time.append(interrupted.wait(10.0))

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            in_background(compute)
    finally:
        signal.signal(signal.SIGINT, before)
    interrupted.set()
    while not in_time:
        time.sleep(0.01)
    assert in_time == [True]


@pytest.mark.parametrize("wait", [0.4, 0.7, 1.1, 1.6])
def test_a_process_that_is_interrupted_while_it_computes_ends_in_good_order(wait: float) -> None:
    """A thread in a Fourier transform would abort a Python that has ended."""
    program = """
import signal
import numpy as np
from scipy.fft import irfft, rfft
from model_discrepancy.fit.parallel import in_background, in_parallel

# A shell lets what runs behind it ignore the signal.
signal.signal(signal.SIGINT, signal.default_int_handler)
noise = np.random.default_rng(0).standard_normal(30000)

def transform(_):
    return [irfft(rfft(noise)) for _ in range(20)]

print("begins", flush=True)
in_background(lambda: [in_parallel(transform, range(8)) for _ in range(2000)])
"""
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    try:
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(wait)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=30.0)
    finally:
        process.kill()
    assert process.returncode == -signal.SIGINT
    assert b"terminate called" not in said
