"""The visit's check list: what is measured, what is refused; nothing is armed before it."""

import asyncio
from datetime import datetime, timezone

import numpy as np
import pytest

from ankle_physics.model import Model
from biofeedback.errors import CommandError, ProtocolError
from biofeedback.session.calibration_files import (
    file_checks,
    rig_calibration,
    session_calibration,
)
from biofeedback.session.check_list import (
    CHECKS,
    DONE,
    FAILED,
    OPEN,
    RUNNING,
    BodyReading,
    CheckList,
)
from biofeedback.session.commands import Command
from biofeedback.session.protocol import load_protocol

PERIOD = 1 / 30


def measure(checks, name, torque, angle=lambda t: 0.0, emg=None):
    """Run a check with signals as functions of time."""
    checks.begin(name, 0.0)
    for k in range(1, round(CHECKS[name].duration / PERIOD) + 2):
        t = k * PERIOD
        ended = checks.tick(t, BodyReading(torque(t), angle(t), emg(t) if emg else {}))
        if ended:
            return checks.states[name], checks.results[name]
    raise AssertionError("it did not end")


def test_zero_is_that_of_a_relaxed_subject():
    checks = CheckList(("zero",))
    state, result = measure(checks, "zero", lambda t: 3.0 * np.sin(4 * t))
    assert state == FAILED
    assert "a relaxed subject stays within 0.5 N.m" in result["problem"]
    state, result = measure(checks, "zero", lambda t: -0.31, lambda t: 0.012)
    assert state == DONE
    assert result == {"torque[N.m]": -0.31, "angle[rad]": 0.012}


@pytest.mark.parametrize(("name", "sign"), [("mvc_plantarflexion", -1), ("mvc_dorsiflexion", 1)])
def test_a_maximal_contraction_is_what_is_held_not_a_peak(name, sign):
    checks = CheckList((name,))

    def torque(t):
        return sign * (90.0 if 1.0 < t < 1.05 else 40.0 if 2.0 < t < 4.0 else 0.0)

    def emg(t):
        return {"SOL": 2e-4 if 2.0 < t < 4.0 else 1e-6, "TA": 1e-5}

    state, result = measure(checks, name, torque, emg=emg)
    assert state == DONE
    assert result["torque[N.m]"] == pytest.approx(sign * 40.0, abs=6.0)
    assert result["SOL[V]"] == pytest.approx(2e-4, rel=0.01)
    # Pushing the other way is no contraction of this one.
    state, result = measure(checks, name, lambda t: -sign * 40.0)
    assert state == FAILED
    assert "in this direction" in result["problem"]


@pytest.mark.parametrize(
    ("arrives", "kept"),
    [
        (lambda t: t > 0.5, True),
        (lambda t: round(20.0 * t) % 2 == 0, False),
        (lambda t: False, False),
    ],
    ids=["late", "with gaps", "never"],
)
def test_a_reading_without_emg_spoils_no_contraction_that_was_held_with_it(arrives, kept):
    def emg(t):
        return {"SOL": 2e-4 if 2.0 < t < 4.0 else 1e-6} if arrives(t) else {}

    state, result = measure(
        CheckList(("mvc_plantarflexion",)),
        "mvc_plantarflexion",
        lambda t: -40.0 if 2.0 < t < 4.0 else 0.0,
        emg=emg,
    )
    assert state == DONE
    assert ("SOL[V]" in result) is kept
    assert result.get("SOL[V]", 2e-4) == pytest.approx(2e-4, rel=0.01)


def test_a_contraction_counts_from_the_torque_of_the_relaxed_leg():
    checks = CheckList(("zero", "mvc_plantarflexion"))
    measure(checks, "zero", lambda t: -2.5)
    _, result = measure(checks, "mvc_plantarflexion", lambda t: -42.5 if 1.0 < t < 4.0 else -2.5)
    assert result["torque[N.m]"] == pytest.approx(-40.0)


def test_a_range_of_motion_has_room_for_the_perturbation():
    checks = CheckList(("range_of_motion",))
    state, result = measure(checks, "range_of_motion", lambda t: 0.0, lambda t: 0.02 * np.sin(t))
    assert state == FAILED
    state, result = measure(checks, "range_of_motion", lambda t: 0.0, lambda t: 0.2 * np.sin(t))
    assert result == {
        "lower[rad]": pytest.approx(-0.2, abs=0.01),
        "upper[rad]": pytest.approx(0.2, abs=0.01),
    }


def test_a_measurement_without_signals_fails():
    checks = CheckList(("zero",))
    state, result = measure(checks, "zero", lambda t: float("nan"))
    assert (state, result["problem"]) == (FAILED, "no signals came")


def test_what_was_done_is_known_after_a_restart():
    checks = CheckList(("rig_calibration", "zero", "warm_up"))
    checks.begin("rig_calibration", 0.0)
    measure(checks, "zero", lambda t: 0.1)
    again = CheckList(("rig_calibration", "zero", "warm_up"))
    again.resume(checks.saved())
    assert again.missing == ["Warm-up"]
    assert again.results["zero"] == checks.results["zero"]


def test_a_protocol_names_its_checks(tmp_path):
    from laboratory import short_protocol

    assert short_protocol(tmp_path).check_list == ()
    path = tmp_path / "short.yaml"
    text = path.read_text()
    path.write_text(text + "check_list: [zero, warm_up]\n")
    assert load_protocol(str(path)).check_list == ("zero", "warm_up")
    path.write_text(text + "check_list: [zero, colour]\n")
    with pytest.raises(ProtocolError, match="check 'colour' is unknown; allowed: rig_calibration"):
        load_protocol(str(path))


def test_nothing_is_armed_before_the_check_list_is_complete(tmp_path):
    from virtual_session import short_session

    virtual = short_session(tmp_path, check_list=("rig_calibration", "warm_up"))
    with pytest.raises(CommandError, match="Rig calibration in date, Warm-up"):
        virtual.command("arm")
    assert virtual.rig.requests == []

    def check(name, act):
        command = Command(1, "check", {"check": name, "act": act})
        asyncio.run(virtual.runner.carry_out(command))

    check("rig_calibration", "begin")
    with pytest.raises(CommandError, match="Warm-up"):
        virtual.command("arm")
    check("warm_up", "skip")
    virtual.command("arm")
    assert virtual.rig.requests == ["arm"]
    written = [(e.event, e.details["check"]) for e in virtual.events if "check" in e.details]
    assert written == [("check done", "rig_calibration"), ("check skipped", "warm_up")]


RIG = """
rig: laboratory 2
calibrated: 2026-11-01T08:00:00Z
terms:
  - term: footplate_inertia
    Ip[kg.m^2]: 0.004
"""


def test_the_rigs_calibration_is_read_from_its_file(tmp_path):
    path = tmp_path / "rig.yaml"
    path.write_text(RIG)
    day = datetime(2026, 11, 20, 8, tzinfo=timezone.utc)
    assert rig_calibration(str(path), 90.0, day) == {"calibrated": "2026-11-01", "age[d]": 19.0}
    with pytest.raises(CommandError, match=r"19 days ago .*allowed: 0 to 14 days; calibrate again"):
        rig_calibration(str(path), 14.0, day)
    with pytest.raises(CommandError, match="set the parameter rig_file"):
        rig_calibration("", 14.0, day)
    path.write_text("rig: 3")
    with pytest.raises(CommandError, match="ankle calibrate rig"):
        rig_calibration(str(path), 90.0, day)


def test_the_sessions_calibration_is_one_of_this_visit(tmp_path):
    path = tmp_path / "subject.yaml"
    Model.of().save(path)
    written = path.stat().st_mtime
    assert "stiffness" in session_calibration(str(path), written + 60.0)["terms"]
    with pytest.raises(CommandError, match="is 24 h old; allowed: up to 12 h"):
        session_calibration(str(path), written + 86400.0)
    with pytest.raises(CommandError, match="ankle calibrate session"):
        session_calibration(str(tmp_path / "none.yaml"))


def test_what_files_answer_needs_no_hand(tmp_path):
    path = tmp_path / "rig.yaml"
    path.write_text(RIG)
    from_files = file_checks(str(path), 36500.0, str(tmp_path / "subject.yaml"))
    checks = CheckList(("rig_calibration", "session_calibration", "warm_up"), from_files)
    assert checks.read_files() == ["rig_calibration"]
    assert checks.states["session_calibration"] == FAILED
    assert checks.missing == ["Session calibration", "Warm-up"]
    Model.of().save(tmp_path / "subject.yaml")
    checks.begin("session_calibration", 0.0)
    assert checks.missing == ["Warm-up"]


def test_the_shipped_visit_has_the_whole_check_list():
    of_a_rig = {"no_foot_on_plate", "spring_on_plate", "calibrate_rig"}
    whole = tuple(name for name in CHECKS if name not in of_a_rig)
    assert load_protocol("visit").check_list == whole
    assert load_protocol("visit").holds == load_protocol("van_t_veld_2018").holds


def test_nothing_is_measured_before_samples_are_received(tmp_path):
    from virtual_session import short_session

    virtual = short_session(tmp_path, check_list=("zero",))
    command = Command(1, "check", {"check": "zero", "act": "begin"})
    with pytest.raises(CommandError, match="'Zero' cannot be measured: no samples of torque"):
        asyncio.run(virtual.runner.carry_out(command))
    assert virtual.runner.checks.entries.states["zero"] == OPEN
    virtual.signals.feed_samples(np.full((1, 4), virtual.now), 2048.0, virtual.now)
    asyncio.run(virtual.runner.carry_out(command))
    assert virtual.runner.checks.entries.states["zero"] == RUNNING


@pytest.mark.parametrize("name", ["no_foot_on_plate", "spring_on_plate"])
def test_what_keeps_a_person_out_of_a_moving_rig_is_confirmed_and_not_skipped(name):
    checks = CheckList((name,))
    with pytest.raises(CommandError, match="cannot be skipped: confirm it"):
        checks.skip(name)
    assert checks.missing
    checks.begin(name, 0.0)
    assert not checks.missing
