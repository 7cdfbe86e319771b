"""The health of a node, stated from several threads."""

import sys
import threading

from ankle_node.health import ERROR, OK, WARN, Health


def test_the_worst_is_the_level_and_every_sentence_is_there():
    health = Health()
    assert health.status("/left/probe", "rig 1").message == "running"
    assert health.state("clock", WARN, "late") is False  # just reported
    health.state("line", ERROR, "cut")
    health.state("disk", OK, "")
    health.count("samples", 12)
    status = health.status("/left/probe", "rig 1")
    assert (status.name, status.hardware_id, status.level) == ("/left/probe", "rig 1", ERROR)
    assert status.message == "line: cut; clock: late"
    assert [(value.key, value.value) for value in status.values] == [("samples", "12")]


def test_a_repeated_warning_is_no_news():
    health = Health()
    assert health.state("clock", WARN, "late") is True
    assert health.state("clock", WARN, "late again") is False
    health.state("clock", OK, "")
    assert health.state("clock", WARN, "late") is True


def errors_of_readers_beside_writers():
    """What goes wrong in three readings while three threads add entries."""
    health, errors, done = Health(), [], threading.Event()

    def write(number):
        k = 0
        while not done.is_set():
            health.state(f"thing {number} {k % 500}", WARN, "late")
            health.count(f"figure {number} {k % 500}", k)
            k += 1

    threads = [threading.Thread(target=write, args=(number,)) for number in range(3)]
    for thread in threads:
        thread.start()
    try:
        for _ in range(3):
            health.status("/probe", "")
    except RuntimeError as error:  # dictionary changed size during iteration
        errors.append(error)
    finally:
        done.set()
        for thread in threads:
            thread.join()
    return errors


def test_several_threads_state_and_read_at_the_same_time():
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        # Begun anew many times: a dictionary changes its size only while it is being filled.
        errors = [error for _ in range(15) for error in errors_of_readers_beside_writers()]
    finally:
        sys.setswitchinterval(before)
    assert errors == []
