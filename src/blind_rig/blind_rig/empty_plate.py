"""The rig of a trial with its plate empty, as a laboratory records it before a subject comes."""

from __future__ import annotations

import math

import numpy as np

from blind_rig.anatomy import Courses, Interface, Muscle, Reflex, Setup
from blind_rig.courses import Course
from blind_rig.mechanics import cell_stiffness, simulate
from blind_rig.sensors import read
from blind_rig.trial import STEPS_PER_SAMPLE, Recording, Run, Trial, record

# What is left of the foot: the solver needs a body of some inertia.
NEGLIGIBLE_INERTIA = 1e-6  # kg.m^2, kg


def empty_plate(setup: Setup, spring: float = 0.0) -> Setup:
    """Return the rig of a setup without foot, straps and torques of a subject.

    The torque cell stays as it is; the mode of its load rises, because the load is less.

    Parameters
    ----------
    setup
        Of subject and rig.
    spring
        That a laboratory mounts on the plate [N.m/rad]; 0 is none.
    """
    stiffness, damping = cell_stiffness(setup)
    omega = math.sqrt(stiffness / (setup.rig.plate_inertia + NEGLIGIBLE_INERTIA))
    return setup._replace(
        muscle=Muscle(K=spring, B=0.0),
        reflex=Reflex(G=0.0),
        interface=Interface(),
        rig=setup.rig._replace(
            foot_inertia=NEGLIGIBLE_INERTIA,
            foot_mass=NEGLIGIBLE_INERTIA,
            strap_k=0.0,
            strap_b=0.0,
            strap_gap=0.0,
            cell_hz=omega / (2.0 * math.pi),
            cell_zeta=damping / (2.0 * (setup.rig.plate_inertia + NEGLIGIBLE_INERTIA) * omega),
        ),
        courses=Courses(torque_level=0.0, voluntary_rms=0.0),
    )


def record_empty_plate(trial: Trial, command: np.ndarray, spring: float = 0.0) -> Recording:
    """Record the rig of a trial with its plate empty, or with a spring on it.

    Parameters
    ----------
    trial
        Whose rig, sensors, sampling rate and angle.
    command
        Reference around the operating angle [rad] at the simulation's rate (`STEPS_PER_SAMPLE`
        times the sampling rate), shape (n,), smooth.
    spring
        On the plate [N.m/rad]; 0 is none.
    """
    setup = empty_plate(trial.setup, spring)
    rate = trial.rate * STEPS_PER_SAMPLE[trial.rate]
    nothing, whole = np.zeros(len(command)), np.ones(len(command))
    momentary = Course(nothing, nothing, whole, whole, setup.reflex.delay * whole)
    motion = simulate(
        setup,
        command,
        momentary.voluntary,
        momentary.muscle_scale,
        momentary.reflex_scale,
        momentary.delay,
        trial.operating_angle,
        rate,
    )
    done = Run(rate, command, motion, momentary, read(motion, setup, rate, trial.seed))
    return record(trial._replace(setup=setup), done)
