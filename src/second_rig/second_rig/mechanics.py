"""Plate, foot and joint, integrated together in small steps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from second_rig.fixation import fixation_torque
from second_rig.parameters import Parameters
from second_rig.torques.air_cushion import air_cushion_torque
from second_rig.torques.cross_bridges import attached_at_rest, cross_bridge_torque
from second_rig.torques.elastic import elastic_torque
from second_rig.torques.friction import SLIDERS, friction_torque, slip_torque
from second_rig.torques.reflex_arc import arc_torque, delay_line
from second_rig.torques.reflex_drive import reflex_drive
from second_rig.torques.relaxation import relaxation_torque
from second_rig.torques.tremor import tremor_torque
from second_rig.torques.viscous import viscous_torque

# Keeps a quotient defined where no stretch was met [rad/s].
LEAST_STRETCH = 1e-12


class Drive(NamedTuple):
    """Holds the movement that the servo wants.

    Attributes
    ----------
    position, velocity, acceleration
        [rad], [rad/s], [rad/s^2], each of shape (n,).
    dt
        Time step [s].
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    dt: float


class Courses(NamedTuple):
    """Holds what changes in the course of a recording by itself.

    Attributes
    ----------
    voluntary
        Torque that the subject holds beside the mean [N.m], shape (n,).
    stretch
        Factor on the reflex to each stretch [1], shape (n,).
    stiffness, reflex
        Factors on K and on the drive of the reflex [1], each of shape (n,).
    tremor
        Steps of the tremor's phase [rad], shape (n,).
    """

    voluntary: np.ndarray
    stretch: np.ndarray
    stiffness: np.ndarray
    reflex: np.ndarray
    tremor: np.ndarray


class Motion(NamedTuple):
    """Holds what happened.

    Attributes
    ----------
    plate, velocity
        Of the plate [rad], [rad/s], each of shape (n,).
    torque
        That the plate takes to be moved [N.m], shape (n,).
    foot
        Position of the foot [rad], shape (n,).
    drive_share
        Drive of the reflex in the stretch velocity that was met [1].
    contraction_share
        Share of K that the reflex' contraction added in the mean [1].
    """

    plate: np.ndarray
    velocity: np.ndarray
    torque: np.ndarray
    foot: np.ndarray
    drive_share: float
    contraction_share: float


def moved(parameters: Parameters, drive: Drive, courses: Courses) -> Motion:
    """Return how plate and foot move, and which torque the plate takes.

    Parameters
    ----------
    parameters
        Of rig and joint.
    drive
        Movement that the servo wants.
    courses
        What changes by itself.
    """
    return Motion(*_integrated(parameters, drive, courses))


@njit(cache=True)
def _integrated(
    parameters: Parameters, drive: Drive, courses: Courses
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float, float]:
    """Integrate semi-implicitly: velocity first, then position with the new velocity."""
    dt, n = drive.dt, drive.position.size
    servo, fixation, reflex = parameters.servo, parameters.fixation, parameters.reflex
    tonic, late, antagonist = (
        parameters.tonic_reflex,
        parameters.late_reflex,
        parameters.antagonist_reflex,
    )
    plate, plate_velocity = np.empty(n), np.empty(n)
    plate_torque, foot = np.empty(n), np.empty(n)
    start = drive.position[0]
    p, v, f, fv = start, 0.0, start, 0.0
    contraction, arms, level = np.zeros(2), np.full(3, start), np.full(1, start)
    bristle, sliders = np.zeros(1), np.zeros(SLIDERS)
    bridges = np.array([attached_at_rest(parameters.cross_bridges), 0.0])
    spindle, oscillator = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    line, muscle = delay_line(reflex.delay, dt), np.zeros(2)
    tonic_line, tonic_muscle = delay_line(reflex.delay, dt), np.zeros(2)
    late_line, late_muscle = delay_line(late.delay, dt), np.zeros(2)
    antagonist_line, antagonist_muscle = delay_line(antagonist.delay, dt), np.zeros(2)
    met, driven = 0.0, 0.0
    for i in range(n):
        if servo.rigid > 0.0:
            p, v = drive.position[i], drive.velocity[i]
        if fixation.compliant == 0.0:
            f, fv = p, v
        stretch = max(fv, 0.0)
        torque = elastic_torque(
            parameters.elastic, contraction, f, courses.stiffness[i], muscle[0], dt
        )
        torque += viscous_torque(parameters.damping, fv)
        torque += parameters.torque + courses.voluntary[i]
        torque += relaxation_torque(parameters.relaxation, arms, f, dt)
        torque += friction_torque(parameters.friction, bristle, fv, dt)
        torque += slip_torque(parameters.slip_elements, sliders, fv, dt)
        torque += cross_bridge_torque(parameters.cross_bridges, bridges, fv, dt)
        torque += air_cushion_torque(parameters.air_cushion, level, f, dt)
        felt = reflex_drive(reflex, spindle, fv, dt) * courses.reflex[i]
        met += stretch
        driven += felt
        asked = reflex.G * felt * courses.stretch[i]
        torque += arc_torque(line, muscle, i, asked, reflex.frequency, reflex.damping, dt)
        if tonic.gain > 0.0:
            beyond = max(f - parameters.elastic.mean_position - tonic.onset, 0.0)
            asked = tonic.gain * beyond
            torque += arc_torque(tonic_line, tonic_muscle, i, asked, tonic.frequency, 1.0, dt)
        if late.gain > 0.0:
            asked = late.gain * stretch * courses.stretch[i]
            torque += arc_torque(late_line, late_muscle, i, asked, late.frequency, 1.0, dt)
        if antagonist.gain > 0.0:
            asked = antagonist.gain * max(-fv, 0.0) * courses.stretch[i]
            torque -= arc_torque(
                antagonist_line, antagonist_muscle, i, asked, antagonist.frequency, 1.0, dt
            )
        torque += tremor_torque(parameters.tremor, oscillator, stretch, courses.tremor[i], dt)
        foot_acceleration = 0.0
        if fixation.compliant > 0.0:
            load, inertia = fixation_torque(fixation, p - f, v - fv), fixation.plate_inertia
            foot_acceleration = (load - torque) / (parameters.inertia - inertia)
        else:
            load, inertia = torque, parameters.inertia
        if servo.rigid > 0.0:
            a = drive.acceleration[i]
        else:
            held = servo.stiffness * (drive.position[i] - p)
            held += servo.damping * (drive.velocity[i] - v)
            held += servo.motor_inertia * drive.acceleration[i]
            a = (held - load) / (servo.motor_inertia + inertia)
        plate[i], plate_velocity[i], foot[i] = p, v, f
        plate_torque[i] = inertia * a + load
        if servo.rigid == 0.0:
            v += dt * a
            p += dt * v
        fv += dt * foot_acceleration
        f += dt * fv
    drive_share = driven / max(met, LEAST_STRETCH)
    return plate, plate_velocity, plate_torque, foot, drive_share, contraction[1] / n
