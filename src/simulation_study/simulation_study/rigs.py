"""Signals and models of the paper's table I: O (original), C (conceptual), CE (conceptual and
experimental).

| | O | C | CE |
| --- | --- | --- | --- |
| edges | blocks behind a 30 Hz actuator | polynomials of 24 ms, then the actuator | as C |
| pulse, start of rise to start of fall | 40 ms | 24 ms, see `pulse_step` | as C |
| velocity, acceleration in the joint | backward differences of position | actual | actual |
| solver | fixed step, 1 ms | exact for the linear parts, 8 kHz | likewise |
| sampling | 1000 Hz | anti-alias filter, 1000 Hz | anti-alias filter, 2048 Hz |
| SNR position / velocity / torque | 70 / - / 40 dB | 70 / - / 40 dB | 52.7 / 37.7 / 24.1 dB |

Source: van 't Veld et al. 2018, sections II-A to II-D. The actuator's order and the pulse's width
are not in the paper.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ankle_physics.actuator import Servo
from ankle_physics.linear_dynamics import Delay, SecondOrder
from ankle_physics.model import Model
from ankle_physics.scenario import Scenario
from ankle_physics.sensors import Noise, SignalToNoise
from ankle_physics.virtual_rig import Recording, simulate
from perturbation_generator.edges import Filtered, Polynomial, Shape
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings
from simulation_study.trial import INERTIA, VISCOSITY, Ankle, Trial

INTRINSIC_TERMS = ("inertia", "viscosity", "stiffness")


@dataclass(frozen=True)
class Rig:
    """Holds signal and model of one condition.

    Attributes
    ----------
    rate
        Of the samples [Hz].
    shape
        Of the edges.
    signal_to_noise
        Of the sensors [dB].
    measures_velocity
        Whether the samples have a velocity.
    differenced
        Whether the joint itself sees backward differences (the original fixed-step model).
    pulse_width
        Start of rise to start of fall [s]; 0: as `PulseStep` chooses.
    servo
        The actuator, whose damping is not in the paper; None: 30 Hz, damping 0.7.
    """

    rate: float
    shape: Shape
    signal_to_noise: SignalToNoise
    measures_velocity: bool
    differenced: bool = False
    pulse_width: float = 0.0
    servo: Servo | None = None


QUIET_SENSORS = SignalToNoise(70.0, np.inf, 40.0)
RIGS = {
    "O": Rig(
        1000.0,
        Filtered(),
        QUIET_SENSORS,
        measures_velocity=False,
        differenced=True,
        pulse_width=0.040,
    ),
    "C": Rig(1000.0, Polynomial(), QUIET_SENSORS, measures_velocity=False),
    "CE": Rig(2048.0, Polynomial(), SignalToNoise(), measures_velocity=True),
}
for _decibel in (50.0, 55.0, 57.0, 59.0, 61.0, 65.0):
    # What a louder position would do to the condition CO.
    RIGS[f"C, position {_decibel:g} dB"] = replace(
        RIGS["C"], signal_to_noise=SignalToNoise(_decibel, np.inf, 40.0)
    )
for _width in (0.032, 0.040):
    # What a longer pulse would do: its fall then overlaps with the velocity of its rise.
    RIGS[f"C, pulse {1e3 * _width:g} ms"] = replace(RIGS["C"], pulse_width=_width)
for _damping in (1.0, 1.4):
    # What an actuator without overshoot would do.
    RIGS[f"C, actuator damping {_damping:g}"] = replace(RIGS["C"], servo=Servo(damping=_damping))
# What sampling as at the real rig would do to an algorithm that differentiates twice.
RIGS["C, 2048 Hz"] = replace(RIGS["C"], rate=2048.0)


def joint(ankle: Ankle) -> Model:
    """Return the paper's model with an ankle's parameters, and voluntary torque where there is
    some.
    """
    terms = {
        "inertia": {"I": INERTIA},
        "viscosity": {"B": VISCOSITY},
        "stiffness": {"K": ankle.K},
        "reflex": {"G": ankle.G, "delay": ankle.delay, "omega": ankle.omega, "z": ankle.z},
    }
    if ankle.voluntary_rms:
        terms["voluntary_torque"] = {"rms": ankle.voluntary_rms, "cutoff": ankle.voluntary_cutoff}
    return Model.of(terms)


def record(trial: Trial) -> Recording:
    """Simulate a trial.

    Raises
    ------
    KeyError
        A rig that is not in `RIGS`.
    ankle_physics.errors.ModelError
        Parameters out of their range.
    """
    rig = RIGS[trial.rig]
    signal = PulseStep(
        Settings(rate=rig.rate, seed=trial.seed, shape=rig.shape), pulse_width=rig.pulse_width
    )
    reference = signal.next(round(trial.seconds * rig.rate))
    scenario = (
        Scenario.from_content({"changes": trial.course.changes()}) if trial.course else Scenario([])
    )
    if rig.differenced:
        return _differenced(rig, reference[:, 0], joint(trial.ankle), scenario, trial)
    return simulate(
        reference,
        rig.rate,
        joint(trial.ankle),
        servo=rig.servo,
        signal_to_noise=rig.signal_to_noise,
        scenario=scenario,
        seed=trial.seed,
    )


def _differenced(
    rig: Rig, position: np.ndarray, model: Model, scenario: Scenario, trial: Trial
) -> Recording:
    """Return the original model: a fixed step, velocity and acceleration as backward differences,
    no anti-alias filter.
    """
    if model.has("voluntary_torque"):
        raise ValueError(f"trial '{trial.name}': the original model has no voluntary torque")
    time = np.arange(len(position)) / rig.rate
    values = {
        f"{entry.term.name}.{p.key}": entry.values[p.symbol]
        for entry in model.entries
        for p in entry.term.parameters
    }
    truth = {key: np.full(len(position), float(value)) for key, value in values.items()}
    for track in scenario.tracks:
        truth[track.key] = track.values(time, float(values[track.key]))
    velocity = np.diff(position, prepend=position[0]) * rig.rate
    acceleration = np.diff(velocity, prepend=0.0) * rig.rate
    ankle = trial.ankle
    stretch = Delay(rig.rate, ankle.delay).run(np.maximum(velocity, 0.0), ankle.delay)
    response = SecondOrder(rig.rate).run(stretch, ankle.omega, ankle.z)
    parts = {
        "inertia": truth["inertia.I[kg.m^2]"] * acceleration,
        "viscosity": truth["viscosity.B[N.m.s/rad]"] * velocity,
        "stiffness": truth["stiffness.K[N.m/rad]"] * position,
        "reflex": truth["reflex.G[N.m.s/rad]"] * response,
    }
    clean = np.column_stack([position, velocity, sum(parts.values(), np.zeros(len(position)))])
    noise = rig.signal_to_noise.deviations(clean)
    return Recording(rig.rate, Noise(noise, trial.seed).add(clean), clean, truth, parts, noise)


def intrinsic_torque(recording: Recording) -> np.ndarray:
    """Return the true torque of inertia, viscosity and stiffness [N.m], shape (n,)."""
    return np.sum([recording.parts[name] for name in INTRINSIC_TERMS], axis=0)
