"""One laboratory with its subject and movement, and what its sensors give with some effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from second_rig.draw import Case
from second_rig.drawing import evenly
from second_rig.effects.effect import Change
from second_rig.mechanics import Courses, Drive, Motion, moved
from second_rig.parameters import Parameters, changed
from second_rig.references import REFERENCES
from second_rig.sampling import LEAD_S, Clock
from second_rig.servo import Servo, servo_response
from second_rig.subject import Subject, draw_subject, stretch_factors
from second_rig.voluntary_torque import voluntary_torque

# Diffusion of the tremor's phase [rad/root(s)]: a physiological tremor keeps its phase for some
# cycles.
TREMOR_DIFFUSION = 2.0


@dataclass(frozen=True)
class Laboratory:
    """Holds what is drawn before any effect comes in.

    Attributes
    ----------
    clock
        Steps and samples.
    subject
        The plain joint.
    servo
        Of the rig.
    reference
        Command [rad], shape (n,) at the engine's steps.
    drive
        Movement that the servo wants.
    courses
        What changes by itself.
    about
        Numbers of protocol, servo, voluntary torque and reflex variation, for the truth.
    """

    clock: Clock
    subject: Subject
    servo: Servo
    reference: np.ndarray
    drive: Drive
    courses: Courses
    about: dict[str, Any]

    @property
    def plain(self) -> Parameters:
        """Return the numbers without any effect."""
        return self.subject.parameters(self.servo)


def draw_laboratory(
    case: Case, protocol: str, clock: Clock, generator: np.random.Generator
) -> Laboratory:
    """Draw subject, movement and servo of a recording.

    Parameters
    ----------
    case
        What is to be recorded.
    protocol
        Key of `references.REFERENCES`, which may differ from that of the case.
    clock
        Steps and samples.
    generator
        Draws all.
    """
    time = clock.time + LEAD_S
    subject = draw_subject(case.effects, generator)
    reference, of_protocol = REFERENCES[protocol](time, generator)
    offset = evenly(generator, -0.05, 0.08)
    reference = reference + offset
    subject = subject._replace(mean_position=float(reference.mean()))
    order = int(generator.choice([2, 3]))
    frequency, ratio = 2.0 * np.pi * evenly(generator, 18.0, 38.0), evenly(generator, 0.7, 1.0)
    lag = 2.0 * np.pi * evenly(generator, 60.0, 120.0) if order == 3 else 0.0
    dt = 1.0 / clock.fast_rate
    drive = Drive(*servo_response(reference, dt, frequency, ratio, lag), dt)
    servo = _draw_servo(case.servo_stiffness, generator)
    variation = evenly(generator, 0.1, 0.3)
    stretch = stretch_factors(drive.velocity, time, variation, generator)
    voluntary, of_will = voluntary_torque(case.voluntary, time, generator)
    tremor = generator.standard_normal(time.size) * np.sqrt(dt) * TREMOR_DIFFUSION
    still = np.ones(time.size)
    about = {
        "protocol": {"kind": protocol, **of_protocol, "offset_rad": offset},
        "servo": {
            "stiffness": case.servo_stiffness,
            "motor_inertia": None if servo.rigid else servo.motor_inertia,
            "damping": None if servo.rigid else servo.damping,
            "order": order,
            "bandwidth_hz": frequency / (2.0 * np.pi),
            "zeta": ratio,
            "extra_lag_rad_s": lag,
        },
        "voluntary": {"kind": case.voluntary, **of_will},
        "reflex_variation_cv": variation,
    }
    courses = Courses(voluntary, stretch, still, still, tremor)
    return Laboratory(clock, subject, servo, reference, drive, courses, about)


def _draw_servo(stiffness: float | None, generator: np.random.Generator) -> Servo:
    inertia, ratio = evenly(generator, 0.012, 0.04), evenly(generator, 0.4, 0.8)
    if stiffness is None:
        return Servo()
    return Servo(0.0, stiffness, 2.0 * ratio * np.sqrt(stiffness * inertia), inertia)


def with_changes(laboratory: Laboratory, changes: Sequence[Change]) -> tuple[Parameters, Courses]:
    """Return the numbers and courses of a laboratory with effects.

    Parameters
    ----------
    laboratory
        Without any.
    changes
        What each effect changes.
    """
    parameters, courses = laboratory.plain, laboratory.courses
    for change in changes:
        parameters = changed(parameters, change.parameters)
        courses = courses._replace(
            voluntary=courses.voluntary + change.torque,
            stiffness=courses.stiffness * change.stiffness,
            reflex=courses.reflex * change.reflex,
        )
    return parameters, courses


def simulated(laboratory: Laboratory, changes: Sequence[Change]) -> Motion:
    """Return what happens with some effects, the torque as the sensor gives it.

    Parameters
    ----------
    laboratory
        Without any.
    changes
        What each effect changes.
    """
    parameters, courses = with_changes(laboratory, changes)
    motion = moved(parameters, laboratory.drive, courses)
    for change in changes:
        if change.sensor is not None:
            motion = motion._replace(torque=change.sensor(motion.torque, laboratory.drive.dt))
    return motion
