"""Recordings whose verdicts are counted: what each hides, and under which conditions.

Every case is drawn from its own seed, so that it can be made again alone. The conditions are what
laboratories and subjects differ by and what is no mismatch: sampling rate, a velocity channel or
none, a recorded command or none, quiet or noisy sensors, the protocol, a servo that is stiff or
gives way, and how much reflex and tremor vary.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.signal import resample_poly

from ankle_physics.term import Place, term_library
from blind_rig import effects
from blind_rig.cases import DRAWS, scaled_effect, shows
from blind_rig.impedance import TrueImpedance, true_impedance
from blind_rig.magnitudes import brought_in
from blind_rig.protocols import EVERY_PROTOCOL, PROTOCOLS, Protocol
from blind_rig.subjects import OPERATING_ANGLE, draw_subject
from blind_rig.trial import Run, Trial, record, run
from model_discrepancy.recording.recording import Recording
from simulation_study.human_trials import load_trial, trial_paths
from simulation_study.planted_from_rig import plant_effect
from simulation_study.planted_in_human import plant

DURATION_S = 60.0
# The engine runs at 1000 and 2048 Hz; a recording at 500 Hz is one at 1000 Hz, filtered.
RATES_HZ = (500.0, 1000.0, 2048.0)
# A servo gives way by some per cent of the movement on an ankle of 100 N.m/rad.
SERVO_STIFFNESS = (2000.0, 3000.0)
SERVO_HZ = (35.0, 60.0)
# Share of a subject's mean reflex by which it varies from stretch to stretch, and rms of tremor
# [N.m].
VARIABILITY = {"small": ((0.0, 0.1), (0.0, 0.05)), "large": ((0.15, 0.3), (0.1, 0.2))}
# Signal to noise of the torque [dB].
TORQUE_SNR = {"quiet": (32.0, 38.0), "noisy": (24.0, 28.0)}
# Of a whole study, so that a count of one kind does not change the cases of another.
KINDS = ("null", "effect", "pair", "foreign", "left_out", "planted", "planted_from_rig")
# Kinds that add torque to recorded human trials: of a term, and of an effect of the rig.
IN_HUMAN_TRIALS = ("planted", "planted_from_rig")
# Answers to these are verdicts, findings in the signals or variability, and no names of terms.
EXCLUDED_EFFECTS = frozenset({"tremor", "position_gain", "encoder_backlash"})
# A planted effect adds torque to a movement that is as it was recorded: a delayed angle does not,
# and straps are in every human trial already.
NOT_PLANTED = frozenset({"torque_delay", "gear_error", "strap"})


@dataclass(frozen=True)
class Plan:
    """Describes one case.

    Attributes
    ----------
    kind
        One of `KINDS`.
    number
        Among those of its kind.
    seed
        Of everything that is drawn.
    hidden
        Names of effects of `blind_rig`, or of the library's term that is planted in a human trial.
    servo
        ``stiff`` or ``compliant``; ``human`` for a recorded trial.
    protocol
        One of `blind_rig.protocols.EVERY_PROTOCOL`; the trial's name for a recorded one.
    rate
        [Hz].
    velocity, reference
        Whether these channels are recorded.
    noise
        A key of `TORQUE_SNR`.
    variability
        A key of `VARIABILITY`.
    scaled
        Whether each hidden effect is brought to a moderate share of the torque's variance in this
        very subject and protocol; otherwise it has the magnitude that is moderate in the nominal
        subject.
    """

    kind: str
    number: int
    seed: int
    hidden: tuple[str, ...]
    servo: str
    protocol: str
    rate: float
    velocity: bool
    reference: bool
    noise: str
    variability: str
    scaled: bool = False

    @property
    def name(self) -> str:
        """Return the name of the case, unique within a study."""
        return f"{self.kind}-{self.number:03d}-{'+'.join(self.hidden) or 'nothing'}"


def plans(counts: dict[str, int], seed: int, trials: Sequence[str] = ()) -> Iterator[Plan]:
    """Draw every case of a study.

    Parameters
    ----------
    counts
        Cases of each of `KINDS`.
    seed
        Of the whole study.
    trials
        Names of recorded trials, for the planted ones.
    """
    for place, kind in enumerate(KINDS):
        generator = np.random.default_rng([seed, place])
        hidden = _hidden(kind, counts.get(kind, 0), generator)
        for number, names in enumerate(hidden):
            drawn = np.random.default_rng([seed, place, number])
            yield _plan(kind, number, names, drawn, trials)


def _hidden(kind: str, count: int, generator: np.random.Generator) -> list[tuple[str, ...]]:
    """Return what each case of a kind hides: every effect once before any comes again."""
    if kind == "null":
        return [()] * count
    known = [e.name for e in effects.KNOWN_EFFECTS if e.name not in EXCLUDED_EFFECTS]
    if kind == "planted_from_rig":
        names = [name for name in known if name not in NOT_PLANTED]
    elif kind == "planted":
        terms = term_library().items()
        # What the position sensor does, changes no torque.
        names = [n for n, t in terms if t.searched and t.place is not Place.POSITION_SENSOR]
    else:
        names = [e.name for e in effects.UNKNOWN_EFFECTS] if kind == "foreign" else known
    order = [str(n) for k in range(count // len(names) + 2) for n in generator.permutation(names)]
    if kind != "pair":
        return [(name,) for name in order[:count]]
    pairs: list[tuple[str, ...]] = []
    while len(pairs) < count:
        first, second = (
            effects.EFFECTS_BY_NAME[str(n)] for n in generator.choice(known, 2, replace=False)
        )
        if first.place != second.place and _protocols((first.name, second.name)):
            pairs.append((first.name, second.name))
    return pairs


def _protocols(hidden: Sequence[str]) -> list[str]:
    """Return the protocols that show all of these effects; every one where none is hidden."""
    if not hidden:
        return list(EVERY_PROTOCOL)
    wanted = [
        effects.EFFECTS_BY_NAME[n].protocols or PROTOCOLS
        for n in hidden
        if n in effects.EFFECTS_BY_NAME
    ]
    return [kind for kind in PROTOCOLS if all(kind in some for some in wanted)]


def _plan(
    kind: str,
    number: int,
    hidden: tuple[str, ...],
    generator: np.random.Generator,
    trials: Sequence[str],
) -> Plan:
    human = kind in IN_HUMAN_TRIALS
    return Plan(
        kind,
        number,
        int(generator.integers(2**62)),
        hidden,
        "human" if human else ("stiff", "compliant")[number % 2],
        trials[number % len(trials)]
        if human and trials
        else str(generator.choice(_protocols(hidden))),
        1000.0 if human else float(generator.choice(RATES_HZ)),
        not human and bool(generator.random() < 0.5),
        not human and bool(generator.random() < 0.7),
        str(generator.choice(list(TORQUE_SNR))),
        str(generator.choice(list(VARIABILITY))),
        scaled=not human,
    )


class Made(NamedTuple):
    """Holds the recording of a case and what is true of it.

    Attributes
    ----------
    recording
        To be diagnosed.
    truth
        True impedance; None for a recorded human trial.
    shares
        Of the torque's variance that each hidden effect adds beyond what the paper's model could
        imitate [1], by its name; empty where effects are not scaled.
    """

    recording: Recording
    truth: TrueImpedance | None
    shares: dict[str, float]


def made(plan: Plan, folder: Path | None = None) -> Made:
    """Make the recording of a case.

    Parameters
    ----------
    plan
        From `plans`.
    folder
        With the recorded trials; needed for planted ones only.
    """
    if plan.kind in IN_HUMAN_TRIALS:
        assert folder is not None
        path = next(path for path in trial_paths(folder) if path.stem == plan.protocol)
        name, measured = plan.hidden[0], load_trial(path)
        planted = (
            plant(measured, name)
            if plan.kind == "planted"
            else plant_effect(measured, name, plan.seed)
        )
        return Made(planted.recording, None, {name: planted.share})
    trial, shares = trial_of(plan)
    done = run(trial)
    return Made(recorded(plan, trial, done), true_impedance(trial, done), shares)


def trial_of(plan: Plan) -> tuple[Trial, dict[str, float]]:
    """Return the trial of a case on the independent rig, and the share of the torque's variance
    that each hidden effect adds.

    Parameters
    ----------
    plan
        From `plans`; not one that is planted in a human trial.
    """
    return _scaled_trial(plan) if plan.scaled else (_fixed_trial(plan), {})


def recorded(plan: Plan, trial: Trial, done: Run) -> Recording:
    """Return what the laboratory of a case stores of a run.

    Parameters
    ----------
    plan
        Says the rate and the channels.
    trial, done
        What was run, and how it went.
    """
    samples = record(trial, done)
    channels = [samples.position, samples.torque, samples.velocity, samples.reference[:, 0]]
    if plan.rate < trial.rate:
        step = round(trial.rate / plan.rate)
        channels = [resample_poly(c, 1, step, padtype="line") for c in channels]
    position, torque, velocity, reference = channels
    return Recording(
        plan.rate,
        position,
        torque,
        velocity if plan.velocity else None,
        reference if plan.reference else None,
        name=plan.name,
    )


def _without_effects(plan: Plan, generator: np.random.Generator) -> Trial:
    """Draw subject, servo and protocol of a case."""
    reflex, tremor = VARIABILITY[plan.variability]
    changes = {
        "courses.stretch_variation": float(generator.uniform(*reflex)),
        "courses.tremor_rms": float(generator.uniform(*tremor)),
        "sensors.torque_snr": float(generator.uniform(*TORQUE_SNR[plan.noise])),
    }
    if plan.servo == "compliant":
        changes["rig.servo_k"] = float(generator.uniform(*SERVO_STIFFNESS))
        changes["rig.servo_hz"] = float(generator.uniform(*SERVO_HZ))
    protocol = Protocol(plan.protocol, float(generator.uniform(0.03, 0.045)), 0.024, DURATION_S)
    return Trial(
        draw_subject(generator).replaced(changes),
        protocol,
        max(plan.rate, 1000.0),
        float(generator.uniform(*OPERATING_ANGLE)),
        int(generator.integers(2**62)),
    )


def _fixed_trial(plan: Plan) -> Trial:
    """Return the trial with each effect as large as is moderate in the nominal subject."""
    trial = _without_effects(plan, np.random.default_rng(plan.seed))
    for name in plan.hidden:
        trial = brought_in(trial, name, "moderate")
    return trial


def _scaled_trial(plan: Plan) -> tuple[Trial, dict[str, float]]:
    """Return the trial with each effect at a moderate share of the torque's variance, and the share
    that each reached.

    A subject or a movement in which an effect does not show is drawn again.
    """
    generator = np.random.default_rng(plan.seed)
    for draw in range(DRAWS):
        trial = _without_effects(plan, generator)
        scaled = [
            scaled_effect(trial, effects.EFFECTS_BY_NAME[name], "moderate", generator)
            for name in plan.hidden
        ]
        if draw == DRAWS - 1 or all(shows(about) for _, about in scaled):
            break
    changes = {path: value for change, _ in scaled for path, value in change.items()}
    shares = {about["name"]: about["share"] for _, about in scaled}
    return trial._replace(setup=trial.setup.replaced(changes)), shares
