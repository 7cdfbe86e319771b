"""What the servo does is told from what the joint does: the command is the instrument."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import bilinear, lfilter

from model_discrepancy.fit.generic_bank import cross_score
from model_discrepancy.problem import Problem, prepare
from model_discrepancy.recording.channel_gains import channel_findings
from model_discrepancy.recording.motion import motion_step
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.servo import identify_servo
from simulation_study.planted_trials import simulate_trial
from simulation_study.verdict_cases import Plan, made

COMPLIANCE = 1 / 2500.0


@pytest.fixture(scope="module")
def on_a_soft_servo():
    """A trial whose plate gives way under a tremor and under slow torque, and its disturbance."""
    rigid = simulate_trial({}, seed=11, duration=40.0, protocol="equal")
    command = rigid.position
    generator = np.random.default_rng(3)
    drive = generator.standard_normal(len(command))
    slow = lfilter([1.0], [1.0, -0.998], drive)
    disturbance = 0.5 * (slow / slow.std())
    # The joint answers the movement with its own stiffness, which is small beside the servo.
    moved = -COMPLIANCE * (rigid.torque - rigid.torque.mean() + disturbance)
    moved = lfilter([0.05], [1.0, -0.95], moved)
    torque = rigid.torque + disturbance + 100.0 * moved
    recording = replace(
        rigid, position=command + moved, torque=torque, velocity=None, reference=command
    )
    return recording, disturbance


def test_a_servo_that_gives_way_is_measured(on_a_soft_servo):
    recording, _ = on_a_soft_servo
    servo = identify_servo(recording, motion_step(recording))
    value, error = servo.compliance.magnitude
    assert servo.compliance.significant
    assert value == pytest.approx(COMPLIANCE, rel=0.1)
    assert error < 0.05 * COMPLIANCE
    assert servo.following[0] == pytest.approx(1.0, abs=0.01)


def test_a_controller_with_an_integrator_gives_way_to_fast_torque_alone(on_a_soft_servo):
    recording, _ = on_a_soft_servo
    integrator = 0.5  # s
    step = integrator * recording.rate
    load = recording.torque - recording.torque.mean()
    moved = -COMPLIANCE * lfilter([step, -step], [1.0 + step, -step], load)
    integrating = replace(recording, position=recording.reference + moved)
    servo = identify_servo(integrating, motion_step(integrating))
    assert servo.compliance.significant
    assert servo.compliance.magnitude[0] == pytest.approx(COMPLIANCE, rel=0.05)
    assert np.sum(servo.compliance.weights) == pytest.approx(0.0, abs=0.2 * COMPLIANCE)


def test_it_is_measured_once_for_equal_signals_and_anew_for_others(on_a_soft_servo):
    recording, _ = on_a_soft_servo
    step = motion_step(recording)
    servo = identify_servo(recording, step)
    again = replace(recording, torque=recording.torque.copy(), name="again")
    assert identify_servo(again, step) is servo
    with pytest.raises(ValueError, match="read-only"):
        servo.position[0] = 1.0
    for changed in (
        replace(recording, torque=1.01 * recording.torque),
        replace(recording, position=1.01 * recording.position),
        replace(recording, reference=1.01 * recording.reference),
        replace(recording, rate=1.01 * recording.rate),
    ):
        assert identify_servo(changed, step) is not servo


def test_a_rigid_servo_has_no_compliance():
    recording = simulate_trial({}, seed=12, duration=30.0, protocol="equal")
    recording = replace(recording, reference=recording.position)
    servo = identify_servo(recording, motion_step(recording))
    assert not servo.compliance.significant
    assert np.all(servo.compliance.weights == 0.0)


def test_a_step_that_the_drive_alone_makes_smooth_is_followed():
    """The command jumps; a drive of 24 Hz makes the movement of it."""
    rate, count = 1000.0, 30_000
    generator = np.random.default_rng(5)
    command = np.repeat(generator.uniform(-0.02, 0.02, count // 250), 250)
    numerator, denominator = bilinear([0, 0, 150.0**2], [1, 2 * 0.75 * 150.0, 150.0**2], rate)
    moved = lfilter(numerator, denominator, command)
    noise = 1e-6 * generator.standard_normal(count)
    recording = Recording(rate, moved + noise, 40.0 * moved, reference=command)
    servo = identify_servo(recording, motion_step(recording))
    assert np.std(servo.unexplained) < 3.0 * np.std(noise)


def test_a_servo_that_sags_is_no_gain_error(on_a_soft_servo):
    recording, _ = on_a_soft_servo
    velocity = np.gradient(recording.position) * recording.rate
    recording = replace(recording, velocity=velocity)
    servo = identify_servo(recording, motion_step(recording))
    assert channel_findings(recording, servo) == []


def test_pick_up_from_the_mains_moves_no_plate(on_a_soft_servo):
    recording, _ = on_a_soft_servo
    hum = 0.3 * np.sin(2.0 * np.pi * 50.0 * recording.time)
    step = motion_step(recording)
    quiet, humming = (
        identify_servo(replace(recording, torque=torque), step)
        for torque in (recording.torque, recording.torque + hum)
    )
    assert humming.compliance.significant
    inner = slice(2000, -2000)
    assert np.std((humming.position - quiet.position)[inner]) < 0.02 * np.std(hum) * COMPLIANCE


def test_the_movement_that_is_fitted_with_holds_no_torque_that_no_movement_causes(
    on_a_soft_servo,
):
    recording, disturbance = on_a_soft_servo
    problem = prepare(recording)
    step = motion_step(recording)
    inner = slice(int(4 * problem.fitter.motion.rate), -int(2 * problem.fitter.motion.rate))
    slow = disturbance[::step] - disturbance.mean()
    command = recording.reference[::step]

    def leak(position):
        rest = position - command
        columns = np.column_stack([slow, command - command.mean(), np.gradient(command)])[inner]
        return abs(np.linalg.lstsq(columns, (rest - rest.mean())[inner], rcond=None)[0][0])

    measured = leak(recording.position[::step])
    assert leak(problem.fitter.motion.position) < 0.25 * measured


@pytest.mark.slow
def test_without_a_command_the_holds_tell_how_the_servo_gives_way_at_each_frequency():
    """Voluntary torque, tremor and a reflex that varies move the plate of another engine."""
    plan = Plan(
        "null", 0, 31, (), "compliant", "pulse_step", 1000.0, True, True, "quiet", "large", True
    )
    recording = made(plan).recording
    known = prepare(recording)
    problem = prepare(replace(recording, reference=None))
    assert problem.compliance.precise
    assert problem.gives_way
    assert not problem.in_a_loop
    frequency = np.array([0.0, 5.0, 10.0, 20.0])
    right = known.compliance.response(frequency)
    found = problem.compliance.response(frequency)
    assert np.abs(found / right - 1.0)[:3] == pytest.approx(0, abs=0.05)
    # There the torque that is not the sensor's noise is small.
    assert np.abs(found / right - 1.0)[3] < 0.15
    # What such torque did to the plate does not seem to be predicted by it.
    used = problem.fitter.rows.used
    left = np.var(problem.noise[used]) / np.var(problem.base.residual[used])
    assert left > 0.95


def predicted_of_the_residual(problem):
    """Share that generic regressors predict on unseen rows."""
    parts, residual = problem.parts, problem.base.residual
    matrix = problem.bank.whitened()
    return np.mean([cross_score(matrix, residual, *way) for way in (parts, parts[::-1])])


def noisy_recording(protocol, seed=42):
    plan = Plan(
        "null", 0, seed, (), "compliant", protocol, 1000.0, True, True, "noisy", "small", True
    )
    return made(plan).recording


@pytest.mark.parametrize(
    "protocol", ["binary", pytest.param("equal_steps", marks=pytest.mark.slow)]
)
def test_the_torque_sensors_noise_is_not_put_into_a_movement_whose_command_is_known(protocol):
    """Regressors of such a movement would predict the noise: 30 and 19 % of the residual."""
    problem = prepare(noisy_recording(protocol, 43))
    assert problem.gives_way
    assert predicted_of_the_residual(problem) < 0.02


def test_what_the_torque_sensors_noise_did_not_move_is_not_taken_out_of_the_movement():
    """It is in the torque, so that the movement would seem to predict it."""
    problem = prepare(replace(noisy_recording("equal_steps"), reference=None))
    assert problem.gives_way
    assert predicted_of_the_residual(problem) < 0.02


@pytest.mark.slow
def test_torque_that_is_noise_does_not_seem_to_move_the_plate():
    """A sum of sines of 0.1 to 20 Hz leaves noise alone above."""
    problem = prepare(noisy_recording("multisine"))
    assert problem.compliance.limit < 30.0
    assert predicted_of_the_residual(problem) < 0.01
    assert prepare(noisy_recording("pulse_step")).compliance.limit > 40.0


UNKNOWN = SimpleNamespace(precise=False)


@pytest.mark.parametrize(
    ("servo", "compliance", "gives_way", "expected"),
    [
        (None, UNKNOWN, True, True),
        (None, UNKNOWN, False, False),
        (None, SimpleNamespace(precise=True), True, False),
        (None, None, False, True),  # never held still: nobody knows
        ("its command was recorded", None, False, False),
    ],
)
def test_the_movement_may_hold_torque_unless_command_or_holds_tell(
    servo, compliance, gives_way, expected
):
    problem = SimpleNamespace(servo=servo, compliance=compliance, gives_way=gives_way)
    assert Problem.in_a_loop.fget(problem) is expected
