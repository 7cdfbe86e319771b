"""Broken rigs are recognised, usable recordings pass, small lags or gains are findings."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import bilinear, butter, lfilter, sosfiltfilt

from ankle_physics.memory_elements import BacklashOperator
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.recording.channel_gains import channel_findings, trusted
from model_discrepancy.recording.motion import motion_step
from model_discrepancy.recording.reading import STRANGE_COMMAND_SENTENCE, check
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.recording_checks import faults
from model_discrepancy.recording.servo import identify_servo
from model_discrepancy.recording.torque_range import range_sentences
from model_discrepancy.recording.velocity_coupling import coupling_corner
from model_discrepancy.tools.candidate_movements import candidates_for
from simulation_study import planted_in_human, verdict_cases
from simulation_study.independent_conduct import IndependentConduct
from simulation_study.planted_in_human import plant
from simulation_study.planted_trials import simulate_trial
from simulation_study.verdict_cases import Plan, made, trial_of

BREAKAGES = {
    "wrong sign": lambda r: replace(r, torque=-r.torque),
    "degrees": lambda r: replace(r, position=np.degrees(r.position), velocity=None),
    "wrong unit": lambda r: replace(r, torque=1000.0 * r.torque),
    "dead": lambda r: replace(r, torque=np.zeros_like(r.torque)),
    "saturated": lambda r: replace(r, torque=np.clip(r.torque, *np.percentile(r.torque, [3, 97]))),
    # More than half of the samples: the flat ones are then no sign of a channel without noise.
    "torque is saturated": lambda r: replace(
        r, torque=np.minimum(r.torque, np.percentile(r.torque, 45))
    ),
    "stuck": lambda r: replace(
        r, torque=np.where(r.time > 30.0, r.torque[int(30 * r.rate)], r.torque)
    ),
    "torque comes 40 ms after": lambda r: replace(r, torque=np.roll(r.torque, int(0.04 * r.rate))),
    "torque comes 40 ms before": lambda r: replace(
        r, torque=np.roll(r.torque, -int(0.04 * r.rate))
    ),
    "movement explains": lambda r: replace(
        r, torque=np.random.default_rng(0).standard_normal(len(r.torque))
    ),
    "spikes": lambda r: replace(r, torque=r.torque + 80.0 * (np.arange(len(r.torque)) % 4999 == 0)),
    "not finite": lambda r: replace(r, torque=np.where(r.time == r.time[500], np.nan, r.torque)),
    "no excitation": lambda r: replace(
        r, position=1e-5 * np.random.default_rng(0).standard_normal(len(r.position)), velocity=None
    ),
    "velocity has the wrong sign": lambda r: replace(r, velocity=-r.velocity),
    "velocity is": lambda r: replace(r, velocity=np.degrees(r.velocity)),
}


@pytest.mark.parametrize("words", BREAKAGES)
def test_a_broken_rig_is_named(null_recording, words):
    found = faults(BREAKAGES[words](null_recording))
    assert found
    if words.startswith("torque comes"):
        # The clocks are found to some milliseconds.
        *start, way = words.split()
        said = found[0].split(": ")[1].split(";")[0].split()
        assert said[:2] == start[:2]
        assert float(said[2]) == pytest.approx(40.0, abs=5.0)
        assert said[3:] == ["ms", way, "the", "position"]
    else:
        assert words in found[0]


def test_torque_that_is_cut_before_noise_is_added_is_saturated(null_recording):
    cut = np.maximum(null_recording.torque, np.percentile(null_recording.torque, 6))
    cut += 0.02 * np.random.default_rng(2).standard_normal(len(cut))
    (found,) = faults(replace(null_recording, torque=cut))
    assert "lower end" in found
    assert "also while the plate moves" in found


def test_torque_that_is_held_at_one_speed_is_not_saturated():
    """A viscous load on ramps of one speed: torque of one value, also while the plate moves."""
    rate, period = 1000.0, 2000
    up = np.clip(np.arange(period) - 200.0, 0.0, 600.0) - np.clip(
        np.arange(period) - 1200.0, 0.0, 600.0
    )
    position = 1e-4 * np.tile(up, 20)
    noise = np.random.default_rng(3).standard_normal((2, len(position)))
    velocity = np.gradient(position) * rate
    assert range_sentences(5.0 * velocity + 0.01 * noise[0], position, rate) == []
    faster = position + 0.01 * np.sin(2.0 * np.pi * 1.7 * np.arange(len(position)) / rate)
    torque = 5.0 * np.gradient(faster) * rate
    cut = np.minimum(torque, np.percentile(torque, 80)) + 0.01 * noise[1]
    assert "upper end" in range_sentences(cut, faster, rate)[0]


def test_swapped_channels_are_told_from_a_wrong_unit(null_recording):
    turned = {"position": null_recording.torque, "torque": null_recording.position}
    (swapped,) = faults(replace(null_recording, **turned, velocity=None))
    assert "position and torque are swapped, it seems" in swapped
    assert "degrees" not in swapped
    degrees = replace(null_recording, position=np.degrees(null_recording.position), velocity=None)
    (wrong,) = faults(degrees)
    assert wrong.endswith("probably degrees or a wrong scale, or position and torque are swapped")


def test_a_rate_below_the_least_is_refused_with_it(null_recording):
    with pytest.raises(DiagnosisError, match=r"sampling rate 102\.4 Hz is below 250 Hz, the least"):
        replace(null_recording, rate=102.4)


def test_a_short_recording_is_refused(null_recording):
    n = int(10 * null_recording.rate)
    short = replace(
        null_recording,
        position=null_recording.position[:n],
        torque=null_recording.torque[:n],
        velocity=None,
    )
    assert "lasts 10.0 s" in faults(short)[0]


def test_usable_recordings_pass(null_recording, real_recording):
    assert faults(null_recording) == []
    assert channel_findings(null_recording) == []
    assert faults(real_recording) == []


def test_torque_that_accelerates_the_plate_is_no_spike(null_recording):
    """A command that jumps moves the plate with a short, large torque."""
    second = int(null_recording.rate)
    speed = np.abs(np.gradient(null_recording.position))
    whole = len(speed) // second * second
    fastest = np.argmax(speed[:whole].reshape(-1, second), axis=1)
    torque = null_recording.torque.copy()
    torque[np.arange(0, whole, second) + fastest] += 80.0
    assert not [f for f in faults(replace(null_recording, torque=torque)) if "spikes" in f]


def test_a_small_lag_of_torque_is_no_fault(null_recording):
    assert (
        faults(
            replace(
                null_recording,
                torque=np.roll(null_recording.torque, int(0.006 * null_recording.rate)),
            )
        )
        == []
    )


def test_wrong_velocity_gain_and_lag_are_findings(null_recording):
    (gain,) = channel_findings(replace(null_recording, velocity=1.1 * null_recording.velocity))
    assert gain.name == "channel_gain"
    assert gain.parameters["gain[1]"][0] == pytest.approx(1.1, abs=0.01)
    (lag,) = channel_findings(
        replace(
            null_recording,
            velocity=np.roll(null_recording.velocity, int(0.004 * null_recording.rate)),
        )
    )
    assert lag.name == "velocity_lag"
    assert lag.parameters["lag[s]"][0] == pytest.approx(0.004, abs=0.0005)


def test_physics_that_rings_and_answers_late_is_no_clock_that_is_off():
    recording = simulate_trial(
        {
            "fixation_compliance": {"k_s": 250.0, "b_s": 0.5},
            "antagonist_reflex": {"Ga": 15.0},
        },
        seed=51,
        duration=30.0,
        protocol="equal",
    )
    assert faults(recording) == []
    late = replace(recording, torque=np.roll(recording.torque, int(0.05 * recording.rate)))
    assert faults(late)


NOISY_SUBJECT = {"velocity": True, "noise": "noisy", "variability": "large"}


def with_sizes(plan, sizes):
    """Return the trial of a case with effects of known sizes, which need no search for the size
    that shows as much as is wanted.
    """
    trial, _ = trial_of(plan)
    return trial._replace(setup=trial.setup.replaced(sizes))


def test_torque_that_moves_a_compliant_plate_is_no_wrong_sign():
    """Slow and strongly varying torque moves the plate downwards, against the perturbation."""
    case = ("null", 9, 4409085742087500358, (), "compliant", "pulse_step", 500.0)
    recording = made(Plan(*case, reference=True, **NOISY_SUBJECT)).recording
    assert faults(recording) == []
    assert "wrong sign" in faults(replace(recording, torque=-recording.torque))[0]


@pytest.mark.slow
def test_a_reflex_beside_which_a_passive_joint_explains_little_is_no_wrong_sign():
    """A passive joint explains 4 % of the torque, and 9 % of the mirrored one."""
    hidden = ("reflex_position", "torque_delay")
    case = ("pair", 19, 3160584820394786538, hidden, "compliant", "pulse_step", 500.0)
    recording = made(Plan(*case, reference=False, scaled=True, **NOISY_SUBJECT)).recording
    assert faults(recording) == []
    assert "wrong sign" in faults(replace(recording, torque=-recording.torque))[0]


def test_a_late_reflex_behind_late_torque_is_no_wrong_sign(monkeypatch):
    """At the best skew the mirrored torque is explained better, and as it stands the torque is."""
    plan = Plan(
        "pair",
        37,
        3214818253382174084,
        ("late_reflex", "torque_delay"),
        "compliant",
        "random_levels",
        1000.0,
        velocity=True,
        reference=True,
        noise="quiet",
        variability="small",
    )
    # 2 % of the torque's variance each.
    sizes = {"reflex.late_G": 22.9, "reflex.late_delay": 0.095, "sensors.torque_delay": 0.00545}
    trial = with_sizes(plan, sizes)
    monkeypatch.setattr(verdict_cases, "trial_of", lambda _: (trial, {}))
    assert faults(made(plan).recording) == []


def test_a_slow_movement_that_does_not_show_the_inertia_is_no_wrong_unit():
    """Triangles of 0.2 s leave the torque to a reflex that varies: an inertia of 0.25 kg.m^2."""
    case = ("effect", 44, 2645295806925682303, ("reflex_exponent",), "stiff", "random_levels")
    subject = {"noise": "quiet", "variability": "large"}
    plan = Plan(*case, rate=500.0, velocity=False, reference=True, **subject)
    trial = with_sizes(plan, {"reflex.G": 9.05, "reflex.exponent": 0.204})
    slow = next(c for c in candidates_for(0.03, levels=False) if c.title.startswith("triangles"))
    recording = IndependentConduct(plan, trial)(slow, 30.0, 2)
    assert faults(recording) == []
    assert "wrong unit" in faults(replace(recording, torque=1000.0 * recording.torque))[0]


@pytest.mark.parametrize("real_recording", [1], indirect=True)
def test_a_slow_torque_channel_that_hides_the_inertia_is_no_wrong_unit(real_recording, monkeypatch):
    """It takes its lag times the viscosity from the inertia, here all of it."""
    # The lag [s] is known, so that none is searched for.
    monkeypatch.setattr(planted_in_human, "magnitudes", lambda _: (0.047, 0.05))
    slow = plant(real_recording, "torque_sensor_lag").recording
    assert faults(slow) == []
    milli = replace(real_recording, torque=0.001 * real_recording.torque)
    assert "wrong unit" in faults(milli)[0]


def moved(position, seed=1):
    """A recording of a joint of 80 N.m/rad that follows this position [rad] exactly, at 1024 Hz."""
    rate = 1024.0
    noise = np.random.default_rng(seed).standard_normal((3, len(position)))
    velocity = np.gradient(position) * rate
    torque = 80.0 * position + 0.8 * velocity + 0.014 * np.gradient(velocity) * rate
    return Recording(
        rate,
        position + 2e-5 * noise[0],
        torque + 0.05 * noise[1],
        velocity + 2e-3 * noise[2],
        name="moved",
    )


def test_a_slow_movement_makes_no_gain_of_the_velocity_wrong():
    """Above 1 Hz the derivative of position is mostly the encoder's noise."""
    time = np.arange(60 * 1024) / 1024.0
    ramps = np.interp(time % 10.0, [0.0, 2.0, 4.0, 6.0, 8.0, 10.0], [0.0, 0.2, 0.2, 0.0, 0.0, 0.0])
    smooth = sosfiltfilt(butter(2, 20.0, fs=1024.0, output="sos"), ramps)
    assert faults(moved(smooth)) == []
    noise = np.random.default_rng(4).standard_normal(len(time))
    (reason,) = faults(replace(moved(0.2 * smooth), torque=16.0 * smooth + noise))
    assert "the movement is slow: 0." in reason
    assert "steps or pulses are needed" in reason
    for position in (smooth, 0.03 * np.sin(2 * np.pi * time)):
        assert channel_findings(moved(position)) == []
    wrong = moved(0.03 * np.sin(2 * np.pi * time))
    (found,) = channel_findings(replace(wrong, velocity=1.1 * wrong.velocity))
    assert found.parameters["gain[1]"][0] == pytest.approx(1.1, abs=0.01)
    assert [f for f in faults(replace(wrong, velocity=57.3 * wrong.velocity)) if "unit" in f]


def test_one_movement_does_not_tell_how_much_a_gain_scatters():
    position = np.where(np.arange(60 * 1024) > 5 * 1024, 0.05, 0.0)
    smooth = sosfiltfilt(butter(2, 20.0, fs=1024.0, output="sos"), position)
    one = moved(smooth)
    assert channel_findings(replace(one, velocity=1.2 * one.velocity)) == []


def test_the_command_of_another_recording_is_not_used(null_recording):
    followed = replace(null_recording, reference=null_recording.position)
    strange = replace(followed, reference=followed.position[::-1].copy())
    read = check(strange)
    assert STRANGE_COMMAND_SENTENCE in read.recording.notes
    assert identify_servo(strange, motion_step(strange)) is None
    assert check(followed).recording.notes == ()


def stepped(seconds=60.0, hold=0.5, seed=3):
    """Steps of random size [rad] at 1024 Hz, as a drive of 20 Hz makes them."""
    count = round(seconds * 1024)
    steps = np.random.default_rng(seed).uniform(-0.02, 0.02, round(seconds / hold))
    held = np.repeat(steps, round(hold * 1024))[:count]
    return sosfiltfilt(butter(2, 20.0, fs=1024.0, output="sos"), held)


@pytest.mark.parametrize("corner", [0.1, 0.5, 2.0])
def test_a_velocity_that_is_coupled_by_a_capacitor_is_no_backlash(corner):
    one = moved(stepped())
    coupled = lfilter(*butter(1, corner, "high", fs=1024.0), one.velocity)
    (found,) = channel_findings(replace(one, velocity=coupled))
    assert found.name == "velocity_coupling"
    assert found.parameters["corner[Hz]"][0] == pytest.approx(corner, rel=0.1)
    assert f"slower than {found.parameters['corner[Hz]'][0]:.2g} Hz" in found.sentence
    assert trusted(one, [found]).velocity is None


def test_backlash_and_a_late_velocity_are_no_coupling():
    one = moved(stepped())
    shaken = replace(one, position=BacklashOperator().run(one.position, 0.002))
    late = replace(one, velocity=np.roll(one.velocity, 5))
    assert [coupling_corner(each) for each in (one, shaken, late)] == [None, None, None]
    assert [found.name for found in channel_findings(shaken)] == ["backlash"]


def test_a_foot_that_moves_now_and_then_has_no_dead_torque():
    time = np.arange(60 * 1024) / 1024.0
    pulses = np.where((time > 5.0) & (time % 7.0 < 0.05), 0.03, 0.0)
    one = moved(sosfiltfilt(butter(2, 20.0, fs=1024.0, output="sos"), pulses))
    assert not [fault for fault in faults(one) if "dead" in fault]
    noise = 0.01 * np.random.default_rng(2).standard_normal(len(time))
    lost = np.where((time > 20.0) & (time < 30.0), noise, one.torque)
    assert [fault for fault in faults(replace(one, torque=lost)) if "dead" in fault]


def test_strong_late_reflexes_are_no_clocks_that_are_apart():
    """A relaxed ankle: its reflexes make most of the torque, the late one more than the first."""
    rate = 1000.0
    levels = np.random.default_rng(5).choice([-0.03, 0.03], 300)
    position = sosfiltfilt(butter(2, 12.0, fs=rate, output="sos"), np.repeat(levels, 200))
    velocity = np.gradient(position) * rate
    torque = 0.019 * np.gradient(velocity) * rate + 1.2 * velocity + 22.0 * position
    for gain, delay, omega in ((14.0, 38, 14.0), (20.0, 103, 27.0)):
        muscle = bilinear([omega**2], [1.0, 2.0 * omega, omega**2], fs=rate)
        torque += gain * lfilter(*muscle, np.roll(np.maximum(velocity, 0.0), delay))
    torque += 0.03 * np.random.default_rng(6).standard_normal(len(torque))
    assert faults(Recording(rate, position, torque, None, None, name="late")) == []
