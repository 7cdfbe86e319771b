"""Motor, torque cell, plate, straps and foot in MuJoCo, closed with the joint's own torque in one
compiled loop.

The bodies hang in a chain of coaxial hinges: motor - (torque cell) - plate - (straps) - foot. The
cell is a stiff torsion spring, and its deflection is the measured torque, as in a real one.
Friction acts between plate and frame, so the cell feels it; backlash is a pair of hard stops around
the foot's resting place.
"""

from __future__ import annotations

import ctypes
import math
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from numba import njit

from ankle_interfaces.errors import QuantityError
from blind_rig.anatomy import Setup
from blind_rig.ankle_torque import LONGEST_DELAY, closed_loop

# Motor and gear as seen from the ankle [kg.m^2]: large against the foot, so that the foot hardly
# disturbs the drive.
MOTOR_INERTIA = 0.5
# The inner loop is several times faster than the drive's own bandwidth, which therefore sets what
# the plate does.
LOOP_HZ, LOOP_ZETA = 150.0, 0.8
# Stops of hard rubber: time constant [s] and damping ratio of MuJoCo's soft constraint.
STOP_TIME, STOP_DAMPING = 0.002, 1.0


class Motion(NamedTuple):
    """Holds the motion at every step of the simulation, each of shape (n,).

    Attributes
    ----------
    motor, plate, foot
        Angle from the operating point [rad].
    motor_velocity, plate_velocity
        [rad/s].
    torque
        Of the cell [N.m].
    drive, other_drive
        Of the triceps' and the antagonist's motoneurons [rad/s].
    """

    motor: np.ndarray
    plate: np.ndarray
    foot: np.ndarray
    motor_velocity: np.ndarray
    plate_velocity: np.ndarray
    torque: np.ndarray
    drive: np.ndarray
    other_drive: np.ndarray


def cell_stiffness(setup: Setup) -> tuple[float, float]:
    """Return the stiffness [N.m/rad] and damping [N.m.s/rad] of the torque cell from the mode of
    its load.
    """
    rig = setup.rig
    load = rig.plate_inertia + (0.0 if rig.strap_k > 0 else rig.foot_inertia)
    omega = 2 * math.pi * rig.cell_hz
    return load * omega**2, 2 * rig.cell_zeta * load * omega


def servo_gains(setup: Setup) -> tuple[float, float, float]:
    """Return the gains of the motor's loop on position, velocity and acceleration.

    Units are [N.m/rad], [N.m.s/rad] and [kg.m^2].

    The last is the inertia of motor and gear, too.
    """
    rig = setup.rig
    if rig.servo_k > 0:
        omega = 2 * math.pi * rig.servo_hz
        inertia = rig.servo_k / omega**2
    else:
        omega = 2 * math.pi * LOOP_HZ
        inertia = MOTOR_INERTIA
    return inertia * omega**2, 2 * LOOP_ZETA * inertia * omega, inertia


def gravity_torque(setup: Setup, angle: float) -> float:
    """Return the torque that holds the foot at an absolute angle [rad] against gravity [N.m];
    positive where the plate must push up.
    """
    rig = setup.rig
    return (
        rig.foot_mass
        * 9.81
        * (rig.foot_forward * math.cos(angle) + rig.foot_below * math.sin(angle))
    )


def _mjcf(setup: Setup, operating_angle: float, dt: float) -> str:
    """Describe the rig as a MuJoCo model.

    Angles rise in dorsiflexion: the forefoot (+x) goes up (+z), about the axis -y.
    """
    rig = setup.rig
    stiffness, damping = cell_stiffness(setup)
    motor = servo_gains(setup)[2]
    # The centre of mass adds its own share to the inertia about the axis, so the body keeps the
    # rest.
    offset = rig.foot_mass * (rig.foot_forward**2 + rig.foot_below**2)
    own = max(rig.foot_inertia - offset, 1e-6)
    c, s = math.cos(operating_angle), math.sin(operating_angle)
    x, z = rig.foot_forward * c + rig.foot_below * s, rig.foot_forward * s - rig.foot_below * c
    strap = ""
    if rig.strap_k > 0:
        # Tightened with the subject at rest: the foot's resting place is where the mean torque
        # bends the strap.
        rest = (setup.courses.torque_level + gravity_torque(setup, operating_angle)) / rig.strap_k
        stops = (
            f'limited="true" range="{-rig.strap_gap} {rig.strap_gap}" solreflimit="{STOP_TIME} '
            f'{STOP_DAMPING}"'
            if rig.strap_gap > 0
            else ""
        )
        strap = (
            f'<joint name="strap" type="hinge" axis="0 -1 0" stiffness="{rig.strap_k}" '
            f'damping="{rig.strap_b}" springref="{rest}" {stops}/>'
        )
    bearing = (
        f'<tendon><fixed name="bearing" frictionloss="{rig.bearing_friction}" '
        f'solreffriction="{STOP_TIME} {STOP_DAMPING}">'
        '<joint joint="motor" coef="1"/><joint joint="cell" coef="1"/></fixed></tendon>'
        if rig.bearing_friction > 0
        else ""
    )
    return f"""<mujoco>
  <compiler angle="radian" inertiafromgeom="false"/>
  <option timestep="{dt}" integrator="implicitfast" gravity="0 0 -9.81">\
<flag contact="disable"/></option>
  <worldbody><body name="motor">
    <joint name="motor" type="hinge" axis="0 -1 0"/>
    <inertial pos="0 0 0" mass="1" diaginertia="{motor} {motor} {motor}"/>
    <body name="plate">
      <joint name="cell" type="hinge" axis="0 -1 0" stiffness="{stiffness}" damping="{damping}"/>
      <inertial pos="0 0 0" mass="1" \
diaginertia="{rig.plate_inertia} {rig.plate_inertia} {rig.plate_inertia}"/>
      <body name="foot">{strap}
        <inertial pos="{x} 0 {z}" mass="{rig.foot_mass}" diaginertia="{own} {own} {own}"/>
      </body>
    </body>
  </body></worldbody>
  {bearing}
</mujoco>"""


@lru_cache(maxsize=1)
def _mj_step() -> ctypes._CFuncPtr:  # type: ignore[name-defined]
    """Return MuJoCo's own step as a C function, called by compiled code without the interpreter."""
    folder = Path(mujoco.__file__).parent
    libraries = sorted(
        [
            *folder.glob("libmujoco*.so*"),
            *folder.glob("libmujoco*.dylib"),
            *folder.glob("mujoco*.dll"),
        ]
    )
    if not libraries:
        raise FileNotFoundError(f"the MuJoCo library is missing in {folder}")
    step = ctypes.CDLL(str(libraries[0])).mj_step
    step.argtypes, step.restype = [ctypes.c_void_p, ctypes.c_void_p], None
    return step


def simulate(
    setup: Setup,
    command: np.ndarray,
    voluntary: np.ndarray,
    muscle_scale: np.ndarray,
    reflex_scale: np.ndarray,
    delay: np.ndarray,
    operating_angle: float,
    rate: float,
) -> Motion:
    """Run the rig.

    Parameters
    ----------
    command
        Reference of the drive around the operating point [rad], shape (n,), smooth.
    voluntary
        Voluntary torque [N.m], shape (n,); its mean bends the straps once, before the trial.
    muscle_scale, reflex_scale
        Momentary factors [1], shape (n,).
    delay
        Momentary reflex delay [s], shape (n,).
    operating_angle
        Plate against the horizontal [rad].
    rate
        Steps per second [Hz].

    Raises
    ------
    QuantityError
        A reflex delay beyond `LONGEST_DELAY`.
    FloatingPointError
        The simulation diverged.
    """
    longest = max(float(np.max(delay)), setup.reflex.antagonist_delay, setup.reflex.late_delay)
    if longest > LONGEST_DELAY:
        raise QuantityError(f"reflex delay of {longest:g} s; up to {LONGEST_DELAY:g} s is possible")
    dt = 1.0 / rate
    model = mujoco.MjModel.from_xml_string(_mjcf(setup, operating_angle, dt))
    data = mujoco.MjData(model)
    stiffness, damping = cell_stiffness(setup)
    gains = servo_gains(setup)
    load = setup.courses.torque_level + gravity_torque(setup, operating_angle)
    data.qpos[1] = -load / stiffness
    data.qpos[0] = load / stiffness
    moved = driven(command, setup.rig.drive_hz, setup.rig.drive_zeta, rate)
    out = np.empty((8, len(command)))
    closed_loop(
        _mj_step(),
        model._address,
        data._address,
        data.qpos,
        data.qvel,
        data.qacc,
        data.qfrc_applied,
        moved[0] + load / gains[0] + load / stiffness,
        moved[1],
        moved[2],
        voluntary,
        muscle_scale,
        reflex_scale,
        delay,
        setup.muscle,
        setup.reflex,
        setup.interface,
        setup.rig.foot_inertia,
        (stiffness, damping),
        gains,
        out,
        dt,
    )
    if not np.isfinite(out).all():
        raise FloatingPointError(f"the simulated rig diverged: {setup}")
    return Motion(*out)


@njit(cache=True)
def driven(command: np.ndarray, hertz: float, zeta: float, rate: float) -> np.ndarray:
    """Return position, velocity and acceleration, shape (3, n), that a drive of finite bandwidth
    makes of its reference [rad].
    """
    omega, dt = 2.0 * math.pi * hertz, 1.0 / rate
    moved = np.empty((3, len(command)))
    x, v = command[0], 0.0
    for i in range(len(command)):
        a = omega * omega * (command[i] - x) - 2.0 * zeta * omega * v
        moved[0, i], moved[1, i], moved[2, i] = x, v, a
        v += a * dt
        x += v * dt
    return moved
