"""The engine against closed forms: transfer functions of joint, rig and straps."""

import numpy as np
import pytest
from scipy.signal import lsim, lti

from second_rig.fixation import Fixation, fixation_torque
from second_rig.mechanics import Courses, Drive, moved
from second_rig.parameters import Parameters, changed
from second_rig.servo import Servo, servo_response
from second_rig.torques.elastic import Elastic
from second_rig.torques.reflex_drive import Reflex
from second_rig.torques.viscous import Damping

DT = 1.0 / 32000.0
TIME = np.arange(round(1.2 / DT)) * DT
I, B, K = 0.012, 0.8, 60.0
# Of the largest value: the engine is one step late here or there, in edges of a few milliseconds.
TOLERANCE = 1e-2


def _joint(servo=None, G=0.0):
    return Parameters(
        I, 0.0, Elastic(K, 0.0), Damping(B), Reflex(G, 0.04, 40.0, 0.8), servo or Servo()
    )


def _drive(reference):
    return Drive(*servo_response(reference, DT, 2 * np.pi * 20.0, 0.8, 0.0), DT)


def _still():
    n = TIME.size
    return Courses(np.zeros(n), np.ones(n), np.ones(n), np.ones(n), np.zeros(n))


def _steps():
    return 0.03 * ((TIME > 0.1) * 1.0 - (TIME > 0.5) * 1.0)


def _close(found, expected):
    assert np.max(np.abs(expected)) > 0.0
    assert np.max(np.abs(found - expected)) < TOLERANCE * np.max(np.abs(expected))


def test_a_servo_of_third_order_is_its_transfer_function():
    w, z, lag = 2 * np.pi * 20.0, 0.8, 500.0
    position, velocity, _ = servo_response(_steps(), DT, w, z, lag)
    system = lti([w * w * lag], np.polymul([1.0, 2 * z * w, w * w], [1.0, lag]))
    expected = lsim(system, _steps(), TIME)[1]
    _close(position, expected)
    _close(velocity[1:], np.diff(position) / DT)


def test_torque_on_a_rigid_rig_is_inertia_damping_and_stiffness():
    drive = _drive(_steps())
    motion = moved(_joint(), drive, _still())
    expected = I * drive.acceleration + B * drive.velocity + K * drive.position
    assert np.allclose(motion.torque, expected, rtol=0.0, atol=1e-12)
    assert np.array_equal(motion.plate, drive.position)


def test_a_delayed_reflex_is_its_transfer_function_and_only_of_stretch():
    drive = _drive(_steps())
    reflex = moved(_joint(G=9.0), drive, _still()).torque - moved(_joint(), drive, _still()).torque
    late = np.interp(TIME - 0.04, TIME, np.maximum(drive.velocity, 0.0), left=0.0)
    w, z = 40.0, 0.8
    _close(reflex, lsim(lti([9.0 * w * w], [1.0, 2 * z * w, w * w]), late, TIME)[1])


def test_a_servo_that_gives_way_moves_as_its_transfer_function_says():
    k, b, J = 3000.0, 8.0, 0.02
    drive = _drive(_steps())
    motion = moved(_joint(Servo(0.0, k, b, J)), drive, _still())
    system = lti([J, b, k], [J + I, b + B, k + K])
    expected = lsim(system, drive.position, TIME)[1]
    _close(motion.plate, expected)
    assert np.max(np.abs(motion.plate - drive.position)) > 3e-4


def test_a_foot_in_straps_moves_as_its_transfer_function_says():
    k, b, Ip = 2500.0, 3.0, 0.004
    straps = {
        "fixation.compliant": 1.0,
        "fixation.plate_inertia": Ip,
        "fixation.stiffness": k,
        "fixation.damping": b,
    }
    drive = _drive(_steps())
    motion = moved(changed(_joint(), straps), drive, _still())
    foot = lsim(lti([b, k], [I - Ip, b + B, k + K]), drive.position, TIME)[1]
    _close(motion.foot, foot)
    rate = np.gradient(foot, DT)
    expected = Ip * drive.acceleration + k * (drive.position - foot) + b * (drive.velocity - rate)
    _close(motion.torque, expected)


def test_a_foot_in_a_gap_is_not_pulled():
    gap = {
        "fixation.compliant": 1.0,
        "fixation.plate_inertia": 0.004,
        "fixation.stiffness": 9000.0,
        "fixation.damping": 4.0,
        "fixation.gap": 0.01,
    }
    slow = Drive(np.full(TIME.size, 0.004), np.zeros(TIME.size), np.zeros(TIME.size), DT)
    parameters = changed(_joint(), gap)._replace(elastic=Elastic(K, 0.001))
    motion = moved(parameters, slow, _still())
    # The foot goes to where the joint is at rest, which the gap leaves room for.
    assert motion.foot[-1] == pytest.approx(0.001, abs=1e-4)
    assert abs(motion.torque[-1]) < 0.01
    held = moved(changed(parameters, {"fixation.gap": 0.0}), slow, _still())
    assert held.torque[-1] > 0.1


def test_a_contact_pushes_and_does_not_pull():
    gap = Fixation(1.0, 0.004, 9000.0, 4.0, 0.0, 0.002)
    for side in (-1.0, 1.0):
        assert fixation_torque(gap, side * 0.0015, 0.0) == pytest.approx(side * 4.5)
        assert fixation_torque(gap, side * 0.0015, side * -5.0) == 0.0
    assert fixation_torque(gap, 0.0005, 1.0) == pytest.approx(0.4)


def test_a_pad_stiffens_with_its_extension():
    pad = Fixation(1.0, 0.004, 2000.0, 0.0, 0.002, 0.0)
    soft = fixation_torque(pad, 1e-6, 0.0) / 1e-6
    stiff = (fixation_torque(pad, 0.003, 0.0) - fixation_torque(pad, 0.002, 0.0)) / 0.001
    assert soft == pytest.approx(2000.0, rel=1e-3)
    assert stiff == pytest.approx(2000.0 * (np.sinh(1.5) - np.sinh(1.0)) / 0.5)


def test_an_unknown_number_is_named():
    with pytest.raises(ValueError, match="looseness"):
        changed(_joint(), {"fixation.looseness": 1.0})
