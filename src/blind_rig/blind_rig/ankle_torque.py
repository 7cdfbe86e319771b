"""Torque of the joint: muscle, tissues, foot contact and reflexes, one step at a time, compiled.

Positive is the torque that has to be applied to move the ankle in dorsiflexion. The equations are
written for this rig alone; sources: Kearney, Stein & Parameswaran 1997 (parallel pathways), van 't
Veld 2018 section II (base model), Rack & Westbury 1974 and Kirsch, Boskov & Rymer 1994 (short-range
stiffness and yield), Lakie & Robson 1988 (thixotropy), Dahl 1968 (friction), Fung 1993
(relaxation), Nielsen, Petersen & Crone 1993 and Hultborn et al. 1996 (depression after stretch).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from blind_rig.anatomy import Interface, Muscle, Reflex

# Places of the muscle's states in their array.
MAXWELL, BRIDGES, BONDS, BOND_STRETCH, FRICTION, TENDON, SLID, LIFTED, LIFT = range(9)
MUSCLE_STATES = 9
# Places of the reflexes' states: each arc is torque and its slope; then what the arc has left.
SPINAL, ANTAGONIST, LATE_REFLEX, LENGTH = 0, 2, 4, 6
RESOURCE = 8
REFLEX_STATES = 9
# Longest reflex delay that the ring buffers must hold [s].
LONGEST_DELAY = 0.150
# The drive's exponent is about this velocity, so that its gain there does not depend on the
# exponent.
UNIT_VELOCITY = 1.0
# A heel that lets go or sticks does so within the time in which soft tissue is compressed.
LIFT_TIME = 0.020


@njit(cache=True)
def intrinsic_torque(
    x: float, v: float, scale: float, muscle: Muscle, state: np.ndarray, dt: float
) -> float:
    """Return the torque of muscle and tissues [N.m] at displacement x [rad] and velocity v [rad/s];
    `state` advances by dt [s].

    Parameters
    ----------
    scale
        Momentary factor on K and B (fatigue, co-contraction).
    """
    K = muscle.K * scale * (1.0 + muscle.position_slope * x + muscle.hardening * x * x)
    B = (
        muscle.B
        * scale
        * (1.0 + (muscle.damping_asymmetry if v > 0.0 else -muscle.damping_asymmetry))
    )
    torque = B * v
    if muscle.tendon_share > 0.0:
        # K is what the joint shows at rest: tendon and contractile part in series. Implicit Euler
        # for the contractile length.
        tendon, contractile, b = (
            K / muscle.tendon_share,
            K / (1.0 - muscle.tendon_share),
            muscle.contractile_b * scale,
        )
        state[TENDON] = (b * state[TENDON] + dt * tendon * x) / (b + dt * (tendon + contractile))
        torque += tendon * (x - state[TENDON])
    else:
        torque += K * x

    if muscle.maxwell_k > 0.0:
        decay = math.exp(-dt / muscle.maxwell_tau)
        state[MAXWELL] = state[MAXWELL] * decay + muscle.maxwell_k * v * muscle.maxwell_tau * (
            1.0 - decay
        )
        torque += state[MAXWELL]

    if muscle.bridge_k > 0.0:
        # Attached bridges stretch with the muscle until they yield; detached ones re-attach without
        # stretch.
        stretch = state[BRIDGES] + v * dt - state[BRIDGES] * dt / muscle.bridge_recovery
        state[BRIDGES] = min(max(stretch, -muscle.bridge_yield), muscle.bridge_yield)
        torque += muscle.bridge_k * state[BRIDGES]

    if muscle.thixotropy_k > 0.0:
        bonds = state[BONDS]
        lost = bonds * abs(v) * dt / muscle.thixotropy_break
        state[BONDS] = min(max(bonds + (1.0 - bonds) * dt / muscle.thixotropy_set - lost, 0.0), 1.0)
        # New bonds form unstretched, so the mean stretch falls as they form.
        formed = (1.0 - bonds) * dt / muscle.thixotropy_set / max(state[BONDS], 1e-3)
        state[BOND_STRETCH] = (state[BOND_STRETCH] + v * dt) * (1.0 - min(formed, 1.0))
        torque += muscle.thixotropy_k * state[BONDS] * state[BOND_STRETCH]

    if muscle.hysteresis_torque > 0.0:
        friction = state[FRICTION]
        direction = 1.0 if v > 0.0 else -1.0
        friction += (
            v * dt / muscle.hysteresis_travel * (muscle.hysteresis_torque - direction * friction)
        )
        state[FRICTION] = friction
        torque += friction
    return torque


@njit(cache=True)
def contact_torque(
    x: float,
    v: float,
    acceleration: float,
    K: float,
    inertia: float,
    interface: Interface,
    state: np.ndarray,
    dt: float,
) -> float:
    """Return what a foot adds that slides on its plate or lifts its heel [N.m]."""
    torque = 0.0
    if interface.slide_share > 0.0:
        if v > interface.slide_velocity:
            state[SLID] = 1.0
        elif v < -interface.slide_velocity:
            state[SLID] = 0.0
        torque += interface.slide_share * inertia * state[SLID] * acceleration
    if interface.lift_share > 0.0:
        if x > interface.lift_angle:
            state[LIFTED] = 1.0
        elif x < interface.lift_return:
            state[LIFTED] = 0.0
        state[LIFT] += (state[LIFTED] - state[LIFT]) * dt / LIFT_TIME
        torque -= interface.lift_share * K * state[LIFT] * max(x - interface.lift_return, 0.0)
    return torque


@njit(cache=True)
def _before(history: np.ndarray, now: int, delay: float, dt: float) -> float:
    """Return value of a ring buffer `delay` seconds before index `now`, linear between samples."""
    back = delay / dt
    whole = int(back)
    part = back - whole
    size = len(history)
    return (1.0 - part) * history[(now - whole) % size] + part * history[(now - whole - 1) % size]


@njit(cache=True)
def _twitch(
    drive: float, omega: float, zeta: float, state: np.ndarray, at: int, dt: float
) -> float:
    """Apply second-order muscle dynamics with unit gain at rest: ``y'' = omega^2 (drive - y) - 2
    zeta omega y'``.
    """
    state[at + 1] += dt * (omega * omega * (drive - state[at]) - 2.0 * zeta * omega * state[at + 1])
    state[at] += dt * state[at + 1]
    return state[at]


@njit(cache=True)
def spindle_drive(v: float, reflex: Reflex) -> float:
    """Return the velocity [rad/s] that counts for the motoneurons at a stretch velocity v [rad/s]:
    threshold, exponent, saturation.
    """
    drive = v - reflex.threshold
    if drive <= 0.0:
        return 0.0
    if reflex.exponent != 1.0:
        drive = UNIT_VELOCITY * (drive / UNIT_VELOCITY) ** reflex.exponent
    if reflex.saturation > 0.0:
        drive = reflex.saturation * math.tanh(drive / reflex.saturation)
    return drive


@njit(cache=True)
def reflex_torque(
    now: int,
    displacement: np.ndarray,
    velocity: np.ndarray,
    scale: float,
    delay: float,
    reflex: Reflex,
    state: np.ndarray,
    dt: float,
) -> tuple[float, float, float]:
    """Return the torque of all reflex arcs [N.m], and the drives of the triceps and of its
    antagonist [rad/s].

    Parameters
    ----------
    now
        Index of the present step.
    displacement, velocity
        Ring buffers of the foot's motion, written up to `now`.
    scale
        Momentary factor on the response (fatigue, habituation, activation).
    delay
        Momentary delay of the short arc [s].
    """
    omega, zeta = reflex.omega, reflex.zeta
    drive = spindle_drive(_before(velocity, now, delay, dt), reflex)
    if reflex.depression > 0.0:
        left = state[RESOURCE]
        state[RESOURCE] += (
            1.0 - left
        ) * dt / reflex.depression_recovery - reflex.depression * left * drive * dt
        state[RESOURCE] = min(max(state[RESOURCE], 0.0), 1.0)
        drive *= left
    if reflex.position_gain != 0.0:
        drive *= max(1.0 + reflex.position_gain * _before(displacement, now, delay, dt), 0.0)
    torque = reflex.G * scale * _twitch(drive, omega, zeta, state, SPINAL, dt)
    other = 0.0
    if reflex.antagonist_G > 0.0:
        other = max(-_before(velocity, now, reflex.antagonist_delay, dt), 0.0)
        torque -= reflex.antagonist_G * scale * _twitch(other, omega, zeta, state, ANTAGONIST, dt)
    if reflex.late_G > 0.0:
        late = max(_before(velocity, now, reflex.late_delay, dt), 0.0)
        torque += reflex.late_G * scale * _twitch(late, omega, zeta, state, LATE_REFLEX, dt)
    if reflex.length_G > 0.0:
        torque += (
            reflex.length_G
            * scale
            * _twitch(_before(displacement, now, delay, dt), omega, zeta, state, LENGTH, dt)
        )
    return torque, drive, other


@njit(cache=True)
def reflex_series(
    displacement: np.ndarray, velocity: np.ndarray, reflex: Reflex, dt: float
) -> np.ndarray:
    """Return the torque of the reflexes [N.m] along a given motion of the foot, shape (n,)."""
    torque, state = np.zeros(len(velocity)), np.zeros(REFLEX_STATES)
    state[RESOURCE] = 1.0
    # Arrays that hold the whole motion are ring buffers that never come round, but for the first
    # delay, which is at rest.
    first = int(max(reflex.delay, reflex.antagonist_delay, reflex.late_delay) / dt) + 2
    for i in range(first, len(velocity)):
        torque[i] = reflex_torque(i, displacement, velocity, 1.0, reflex.delay, reflex, state, dt)[
            0
        ]
    return torque


@njit(cache=True)
def closed_loop(  # type: ignore[no-untyped-def]
    step,
    model,
    data,
    qpos: np.ndarray,
    qvel: np.ndarray,
    qacc: np.ndarray,
    applied: np.ndarray,
    command: np.ndarray,
    command_velocity: np.ndarray,
    command_acceleration: np.ndarray,
    voluntary: np.ndarray,
    muscle_scale: np.ndarray,
    reflex_scale: np.ndarray,
    delay: np.ndarray,
    muscle: Muscle,
    reflex: Reflex,
    interface: Interface,
    inertia: float,
    cell: tuple[float, float],
    loop_gains: tuple[float, float, float],
    out: np.ndarray,
    dt: float,
) -> None:
    """Simulate rig and ankle together, step by step; everything that is compiled into it stands in
    this file, since numba's cache watches this file only.

    Parameters
    ----------
    step
        MuJoCo's ``mj_step`` as a C function; `model` and `data` are its addresses.
    qpos, qvel, qacc, applied
        MuJoCo's own arrays: angles, velocities, accelerations of the hinges, torques applied to
        them. command, command_velocity, command_acceleration: of the motor, shape (n,). voluntary,
        muscle_scale, reflex_scale, delay: momentary values, shape (n,) (`courses.Course`).
    inertia
        Of the foot [kg.m^2].
    cell
        Stiffness [N.m/rad] and damping [N.m.s/rad] of the torque cell.
    loop_gains
        Of the motor on position, velocity and acceleration.
    out
        Shape (8, n), receives the fields of `mechanics.Motion`.
    dt
        Step [s].
    """
    n, joints = len(command), len(qpos)
    muscle_state, reflex_state = np.zeros(MUSCLE_STATES), np.zeros(REFLEX_STATES)
    muscle_state[BONDS] = 1.0
    reflex_state[RESOURCE] = 1.0
    size = int(LONGEST_DELAY / dt) + 4
    displacement, velocity = np.zeros(size), np.zeros(size)
    for i in range(n):
        foot, foot_velocity, foot_acceleration = 0.0, 0.0, 0.0
        for joint in range(joints):
            foot += qpos[joint]
            foot_velocity += qvel[joint]
            foot_acceleration += qacc[joint]
        displacement[i % size], velocity[i % size] = foot, foot_velocity
        answer, drive, other = reflex_torque(
            i, displacement, velocity, reflex_scale[i], delay[i], reflex, reflex_state, dt
        )
        torque = voluntary[i] + answer
        torque += intrinsic_torque(foot, foot_velocity, muscle_scale[i], muscle, muscle_state, dt)
        torque += contact_torque(
            foot, foot_velocity, foot_acceleration, muscle.K, inertia, interface, muscle_state, dt
        )
        # All hinges share one axis, so a torque between foot and shank acts on each of them.
        for joint in range(joints):
            applied[joint] = -torque
        applied[0] += loop_gains[0] * (command[i] - qpos[0]) + loop_gains[1] * (
            command_velocity[i] - qvel[0]
        )
        applied[0] += loop_gains[2] * command_acceleration[i]
        out[0, i], out[1, i], out[2, i] = qpos[0], qpos[0] + qpos[1], foot
        out[3, i], out[4, i] = qvel[0], qvel[0] + qvel[1]
        out[5, i] = -cell[0] * qpos[1] - cell[1] * qvel[1]
        out[6, i], out[7, i] = drive, other
        step(model, data)
