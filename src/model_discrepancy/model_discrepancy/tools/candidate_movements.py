"""Movements that a second recording could use: what the perturbation generator can make within its
limits.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Value
from ankle_physics.actuator import Actuator, Servo
from model_discrepancy.recording.motion import MODEL_RATE_HZ, Motion
from perturbation_generator.limits import limits_from
from perturbation_generator.parameters import PARAMETERS
from perturbation_generator.signals import signal_from

# Ranges of movement as multiples of the recorded one; beyond twice of it fitted curves are
# extrapolated too far to be trusted.
RANGES = (0.5, 1.0, 2.0)
# Rms of a movement about its mean, as a multiple of the recorded one. A movement of the recorded
# kind over twice its range has 2.0 to 2.1. One that dwells at the ends of a range which the first
# movement rarely reached has 3 and more: it brings in curves, and friction, that the first
# recording does not describe and that were never at stake.
LARGEST_RMS = 2.5
# Duration of an edge [s]: the paper's, and up to what the generator allows; slow edges with no hold
# are triangles.
EDGES_S = (0.024, 0.06, 0.15)
TRIANGLE_EDGE_S = 0.2
# Holds [s]: shorter than a reflex response, and long enough for a muscle's relaxation to end.
SHORT_HOLDS_S = (0.2, 0.5)
LONG_HOLDS_S = (0.2, 3.0)
# Torque that a subject holds in a task with levels, beside the recorded one [N.m]; a relaxed calf
# and two easy contractions.
LEVELS = (0.0, 4.0, 8.0)
LEVEL_S = 5.0
# Length [s] at which a candidate must be accepted: several cycles of the slowest one.
ACCEPTANCE_DURATION_S = 30.0


@dataclass(frozen=True)
class Candidate:
    """Describes a movement and the subject's task.

    Attributes
    ----------
    title
        In plain words.
    parameters
        Of the perturbation generator that differ from its defaults.
    levels
        Whether the subject holds several torque levels, instead of the recorded one.
    """

    title: str
    parameters: dict[str, Value]
    levels: bool = False

    def reference(self, duration: float, rate: float = 2048.0) -> np.ndarray:
        """Return the position, velocity and acceleration [rad, rad/s, rad/s^2], shape (n, 3).

        Raises
        ------
        QuantityError
            The generator refuses the parameters, or the signal passes a limit.
        """
        values = (
            {p.name: p.default for p in PARAMETERS}
            | self.parameters
            | {"duration": duration, "rate": rate}
        )
        signal = signal_from(values)
        limits_from(values).check(signal, float(values["amplitude"]))
        return signal.next(round(duration * rate))

    def motion(self, duration: float, background: float) -> Motion:
        """Return the motion of a footplate behind a 30 Hz actuator, at the model's rate.

        No torque acts on it.

        Parameters
        ----------
        duration
            [s].
        background
            Torque that the subject holds [N.m].
        """
        rate = 2048.0
        actuator = Actuator(Servo(), rate)
        inner = rate * actuator.factor
        step = int(inner // MODEL_RATE_HZ)
        position, velocity, acceleration = actuator.run(self.reference(duration, rate))[:, ::step]
        time = np.arange(len(position)) * step / inner
        level = (
            np.array(LEVELS)[(time / LEVEL_S).astype(int) % len(LEVELS)]
            if self.levels
            else background
        )
        return Motion(
            inner / step,
            position,
            velocity,
            acceleration,
            np.zeros(len(time)),
            np.zeros(len(time)) + level,
        )


def candidates_for(movement: float, levels: bool, rms: float = math.inf) -> list[Candidate]:
    """Return the candidates that the generator accepts and that are not much larger than what was
    recorded.

    Parameters
    ----------
    movement
        Recorded range of position [rad].
    levels
        Whether tasks with several torque levels are among them.
    rms
        Of the recorded position about its mean [rad]; infinite where it is not known.
    """
    accepted = []
    for candidate in _all(movement, levels):
        try:
            reference = candidate.reference(ACCEPTANCE_DURATION_S)
        except QuantityError:
            continue
        if np.std(reference[:, 0]) <= LARGEST_RMS * rms:
            accepted.append(candidate)
    return accepted


def _all(movement: float, levels: bool) -> Iterator[Candidate]:
    for share in RANGES:
        for task in (False, True) if levels else (False,):
            for title, parameters in _movements(share * movement):
                yield Candidate(
                    title + (", holding several torque levels" if task else ""), parameters, task
                )


def _movements(reach: float) -> Iterator[tuple[str, dict[str, Value]]]:
    """Return the perturbations over a range of `reach` [rad]."""
    one_sided: dict[str, Value] = {"amplitude": round(reach, 4), "direction": "dorsiflexing"}
    both: dict[str, Value] = {"amplitude": round(0.5 * reach, 4), "direction": "both"}
    size = f"over {1000 * reach:.0f} mrad"
    for edge in EDGES_S:
        rise = f"rising in {1000 * edge:.0f} ms"
        yield (
            f"pulses and steps {size}, {rise}",
            {"signal": "pulse_step", **one_sided, "edge_duration": edge},
        )
        for hold in (SHORT_HOLDS_S, LONG_HOLDS_S):
            yield (
                f"steps of random size {size}, {rise}, held {hold[0]:g} to {hold[1]:g} s",
                {"signal": "random_steps", **both, "edge_duration": edge, **_holds(*hold)},
            )
    yield (
        f"triangles of random size {size}, {1000 * TRIANGLE_EDGE_S:.0f} ms each way",
        {
            "signal": "random_steps",
            **both,
            "edge_duration": TRIANGLE_EDGE_S,
            **_holds(TRIANGLE_EDGE_S, TRIANGLE_EDGE_S),
        },
    )
    yield f"pseudo-random binary sequence {size}", {"signal": "prbs", **one_sided}
    yield f"sum of sines of 0.1 to 20 Hz {size}", {"signal": "multisine", **both}


def _holds(shortest: float, longest: float) -> dict[str, Value]:
    return {
        "random_steps.shortest_hold": shortest,
        "random_steps.longest_hold": longest,
        "random_steps.smallest_level": 0.1,
    }
