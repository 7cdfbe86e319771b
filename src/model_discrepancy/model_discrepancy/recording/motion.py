"""Position, velocity and acceleration for fitting: zero-phase, band-limited, from what was
measured.

Where the command was recorded, the movement is what command and load make of the servo (`servo`),
which is free of the encoder's noise; what they do not explain is added as far as it is above that
noise and the one that the torque sensor's makes of it (Wiener). Without a command the measured
position is limited by its noise only. A nonlinear term, friction for one, must see the movement as
sharp as it was; the low-pass comes afterwards, in `rows`, on torque and model torque alike.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.servo import Servo
from model_discrepancy.recording.spectrum import (
    Spectrum,
    clear_share,
    low_pass,
    noise_floor,
    signal_share,
    white_density,
)

# Terms are simulated at this rate or just above: six times the highest frequency that is fitted.
MODEL_RATE_HZ = 500.0
# Slow torque stands for muscle activation: a subject changes it within a second or two,
# perturbations within tenths of a second.
ACTIVATION_HZ = 0.7


@dataclass(frozen=True)
class Motion:
    """Holds the signals that drive the model and are compared with it, at the model's rate.

    Attributes
    ----------
    rate
        [Hz].
    position, velocity, acceleration
        Of the footplate [rad, rad/s, rad/s^2], each of shape (n,).
    torque
        [N.m], shape (n,).
    activation
        Background torque that muscles hold [N.m], shape (n,): slow torque, positive for calf
        activity; `diagnose` takes out of it what the base model makes of the movement.
    sample_time
        Between two samples of the recording [s]: channels are aligned no better than to half of it;
        0 for a simulation.
    noise
        Power density of the errors of position [rad^2/Hz] and of an independent velocity
        [rad^2/s^2/Hz], infinite without one.
    preceding
        What the muscles held before the movement under way, or before and after a moment of a
        continuous one [N.m], shape (n,); nothing of the response to it. None where this is not
        known.
    cocontraction
        Course of the stiffness beyond what the model says, of mean 0 and root mean square 1 [1],
        shape (n,); None where the recording shows none.
    restless
        Whether `preceding` holds earlier responses, since the movements follow each other without
        rest.
    continuous
        Whether the plate hardly ever begins to move from rest.
    """

    rate: float
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    torque: np.ndarray
    activation: np.ndarray
    sample_time: float = 0.0
    noise: tuple[float, float] = (0.0, math.inf)
    preceding: np.ndarray | None = None
    restless: bool = False
    continuous: bool = False
    cocontraction: np.ndarray | None = None

    def position_noise(self, frequency: np.ndarray) -> np.ndarray:
        """Return the power density of the error of `position` [rad^2/Hz] at each frequency [Hz]."""
        position, velocity = self.noise
        return position / (1.0 + position * (2.0 * np.pi * frequency) ** 2 / velocity)

    @property
    def time(self) -> np.ndarray:
        """Return the time since the first sample [s], shape (n,)."""
        return np.arange(len(self.position)) / self.rate


def motion_step(recording: Recording) -> int:
    """Return how many samples of the recording make one sample at the model's rate."""
    return max(1, int(recording.rate // MODEL_RATE_HZ))


def motion_of(recording: Recording, servo: Servo | None = None) -> Motion:
    """Return the filtered motion and torque of a recording at the model's rate.

    Parameters
    ----------
    recording
        Where velocity was measured and no command, it is merged with position, each frequency
        weighted by the two channels' noise floors (the best linear combination for independent
        white noises).
    servo
        What the command explains of the position, by `servo.identify_servo`; None where no command
        was recorded.
    """
    step = motion_step(recording)
    torque = Spectrum(recording.torque, recording.rate, step)
    if servo is not None:
        noise = white_density(servo.unexplained, servo.rate) * servo.uncertainty, math.inf
        rest = Spectrum(servo.unexplained, servo.rate, 1)
        position = Spectrum(servo.position, servo.rate, 1)
        # The servo's model moves the plate by its sensor's noise, too, which the rest takes back.
        by_torque = rest.power_of(white_density(recording.torque, recording.rate))
        moved = np.abs(servo.compliance.response(rest.frequency)) ** 2 * by_torque
        clear = clear_share(rest.values, rest.frequency, moved)
        position.values = position.values + rest.values * clear
        keep = np.ones(len(position.frequency))
        middle = float(recording.position.mean())
    else:
        position = Spectrum(recording.position, recording.rate, step)
        keep = position.anti_alias()
        middle = 0.0
        merged = position.values
        noise = white_density(recording.position, recording.rate), math.inf
        if recording.velocity is not None:
            velocity = Spectrum(recording.velocity, recording.rate, step)
            noise = noise[0], white_density(recording.velocity, recording.rate)
            merged = _merge(position, velocity, 2j * np.pi * position.frequency)
        position.values = merged * signal_share(merged, position.frequency)
    s = 2j * np.pi * position.frequency
    return Motion(
        rate=recording.rate / step,
        position=position.read(keep) + middle,
        velocity=position.read(keep * s),
        acceleration=position.read(keep * s**2),
        torque=torque.read(torque.anti_alias()),
        activation=torque.read(low_pass(torque.frequency, ACTIVATION_HZ, 4)),
        sample_time=1.0 / recording.rate,
        noise=noise,
    )


def _merge(position: Spectrum, velocity: Spectrum, s: np.ndarray) -> np.ndarray:
    """Return the spectrum of position from both channels; at zero frequency position alone."""
    noise_x = noise_floor(position.values, position.frequency)
    noise_v = noise_floor(velocity.values, position.frequency)
    # Velocity v = s x tells x with noise noise_v / |s|^2.
    weight_x = 1.0 / noise_x
    weight_v = np.abs(s) ** 2 / noise_v
    # 0.5 Hz and below: a small offset of the velocity channel must not become drift of position.
    weight_v[position.frequency < 0.5] = 0.0
    s_safe = np.where(s == 0, 1.0, s)
    return (weight_x * position.values + weight_v * velocity.values / s_safe) / (
        weight_x + weight_v
    )
