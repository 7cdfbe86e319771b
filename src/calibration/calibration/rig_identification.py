"""The rig from a recording with the plate empty, or with a known load: everything by its reference.

The reference carries neither noise nor torque, so the part of each channel that follows it is known
far better than the channel itself. That part is found as a smoothed transfer from the reference
(`rig_spectra.FREQUENCY_RESOLUTION` wide), and everything else is fitted to it:

    torque(f)   = S(f) e^(-2 pi i f d) [Ip a(f) + b v(f) + g x(f) + F c(f)]
    velocity(f) = 2 pi i f x(f) e^(-2 pi i f d_v)
    x(f)        = H(f) [r(f) - torque(f) / k_a]

S is 1, a lag or a mode of the torque sensor. It, d and Ip are found where the plate keeps moving
one way, so that friction holds still (`sensor_fit`). Friction and weight are found in all of the
recording (`plate_fit`); c is the course of the friction, tanh(v / v0) while the plate moves, which
relaxes behind a movement (`friction_course`). H is the servo (`servo_fit`), r the reference.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from calibration.fitted_value import Found, stacked_parts, standard_errors
from calibration.friction_course import Friction
from calibration.plate_fit import fit_plate
from calibration.rig_spectra import RigSpectra, Signals, rest_of, scatter
from calibration.sensor_fit import SensorSearch
from calibration.servo_fit import fit_servo

# Of servo and torque in turn; the load changes by less than its error in a fourth.
ROUNDS = 3


@dataclass(frozen=True)
class IdentifiedRig:
    """Holds what was identified of a rig from a recording.

    Attributes
    ----------
    torque_delay, velocity_delay
        After the position [s].
    inertia
        Of everything that moves with the plate [kg.m^2].
    friction, friction_velocity
        Dry friction [N.m], and the velocity [rad/s] that rounds its jump at rest.
    slope
        Torque per angle [N.m/rad]: weight of the plate, and a spring that is mounted.
    lag
        Time constant of the torque sensor [s]; None where it has none.
    mode
        Frequency [Hz] and damping [1] of the torque sensor; None where it has none.
    bandwidth, damping
        Of the servo [Hz], [1].
    servo_stiffness
        k_a [N.m/rad]; None where the load was too small to tell.
    zero_position, zero_torque
        Readings [rad], [N.m] at a command of zero.
    noise
        Standard deviation of position [rad], velocity [rad/s] (None), torque [N.m] at rest.
    vaf
        Of the torque that follows the reference [%].
    """

    torque_delay: Found
    velocity_delay: Found | None
    inertia: Found
    friction: Found
    friction_velocity: Found
    slope: Found
    lag: Found | None
    mode: tuple[Found, Found] | None
    bandwidth: Found
    damping: Found
    servo_stiffness: Found | None
    zero_position: float
    zero_torque: float
    noise: tuple[float, float | None, float]
    vaf: float


def identify_rig(signals: Signals) -> IdentifiedRig:
    """Identify a rig from one recording that begins and ends at rest.

    Parameters
    ----------
    signals
        The recording; about two minutes of the signal ``rig_calibration``.

    Raises
    ------
    CalibrationError
        No rest at the start, no movement, hardly any that keeps its direction, or a torque that
        does not follow the plate.
    """
    rest = rest_of(signals)
    spectra = RigSpectra(signals, rest)
    # First with the torque as it is read, then with the torque that acts, sensor undone: near a
    # mode of the sensor the two differ, and with them the motion of a servo that gives way.
    read = spectra.following(spectra.torque, spectra.reference, known=False)
    servo, search = fit_servo(spectra, read), SensorSearch(spectra, rest)
    friction = Friction()
    for _ in range(ROUNDS):
        motion = spectra.motion(servo.motion)
        sensor = search.run(motion, spectra.following(spectra.position, servo.motion), friction)
        plate = fit_plate(spectra, motion, sensor)
        friction = plate.course
        servo = fit_servo(spectra, read / sensor.response)
    zero_position = float(np.mean((signals.position - signals.reference)[rest]))
    at_rest = float(np.mean(signals.torque[rest]))
    noise = (
        scatter(signals.position[rest]),
        None if signals.velocity is None else scatter(signals.velocity[rest]),
        scatter(signals.torque[rest]),
    )
    return IdentifiedRig(
        torque_delay=sensor.shape["delay"],
        velocity_delay=_velocity_delay(spectra, motion),
        inertia=sensor.inertia,
        friction=plate.friction,
        friction_velocity=plate.friction_velocity,
        slope=plate.slope,
        lag=sensor.shape.get("lag"),
        mode=(
            (sensor.shape["mode"], sensor.shape["mode_damping"]) if "mode" in sensor.shape else None
        ),
        bandwidth=servo.bandwidth,
        damping=servo.damping,
        servo_stiffness=servo.stiffness,
        zero_position=zero_position,
        zero_torque=at_rest,
        noise=noise,
        vaf=plate.vaf,
    )


def _velocity_delay(spectra: RigSpectra, motion: np.ndarray) -> Found | None:
    if spectra.velocity is None:
        return None
    expected = motion * spectra.omega
    goal = stacked_parts(spectra.velocity)

    def left(shape: np.ndarray) -> np.ndarray:
        return goal - shape[1] * stacked_parts(expected * np.exp(-spectra.omega * shape[0]))

    found = least_squares(left, [0.0, 1.0], x_scale=[1e-4, 0.1])
    errors = standard_errors(found.jac, found.fun, spectra.frequency)
    return Found(float(found.x[0]), float(errors[0]))
