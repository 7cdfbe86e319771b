"""A recording is made ready for the search here.

The result holds its movement, its noise, its rows, and the base model's fit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.signal import coherence, welch

from ankle_physics.model import PAPER_TERMS
from ankle_physics.rig_file import RigFile
from ankle_physics.term import REFLEX_PLACES, ModelValues, term_library
from model_discrepancy.fit.base_model import fit_base, is_alignment
from model_discrepancy.fit.closed_loop import Load
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.generic_bank import GenericBank, cross_score
from model_discrepancy.fit.halves import interleaved
from model_discrepancy.fit.held_torque import following
from model_discrepancy.fit.rows import LOW_PASS_HZ
from model_discrepancy.fit.stiffness_course import better_course, stiffness_course
from model_discrepancy.loaded_servo import LoadedServo, fitted_in_loop, gives_way
from model_discrepancy.recording.compliance import Compliance, held_compliance
from model_discrepancy.recording.emg_activation import emg_activation
from model_discrepancy.recording.known_rig import (
    calibrated,
    held_terms,
    known_compliance,
)
from model_discrepancy.recording.motion import ACTIVATION_HZ, Motion, motion_of, motion_step
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.servo import Servo, identify_servo
from model_discrepancy.recording.torque_reading import TorqueReading

Progress = Callable[[str], None]

# Where less of the torque follows the movement than this, rows hold noise alone.
LEAST_COHERENCE = 0.3
# Of the residual's power that the noise of the position may make at any frequency.
LARGEST_NOISE_SHARE = 0.1
# The reflex and the joint's own resonance lie below; a recording is never cut further down.
LOWEST_LIMIT_HZ = 25.0
# Of the whitened residual, that a stiffness gains by following another course, of torque or of its
# own: a search takes a minute, and a named term gains several per cent.
BETTER_COURSE = 0.02
# Of the torque that the base model leaves, by variance, that a found model explains. What is less
# changes the movement by less than a sixth of what was taken from it, and a second search takes as
# long as the first.
CLEARER_MOVEMENT = 0.3
# Resolution of the coherence: 2 Hz, so that a minute gives more than a hundred averages.
_SEGMENT_S = 0.5


@dataclass
class Problem:
    """Holds what every later stage of a diagnosis works on.

    Attributes
    ----------
    recording
        As it was read.
    servo
        How the servo follows its command and gives way; None without a command.
    compliance
        How far the servo gives way, from the command or from the holds; None where neither tells.
    fitter
        Columns and rows, whitened by the recording's noise.
    base
        The base model's fit.
    bank
        Generic regressors of the same movement.
    bank_over_time
        Those whose responses change slowly.
    bank_over_torque
        Those whose responses follow what the muscles held before each movement; None where this is
        not known.
    parts
        Two interleaved halves of the rows, each bool, shape (rows.count,).
    noise
        Whitened residual without what generic regressors predict of it, shape (rows.count,).
    activation_by_emg
        Whether the muscles' activation follows from EMG; else from slow torque.
    reading
        How the torque sensor reads what acts on the plate, as the movement was computed.
    """

    recording: Recording
    servo: Servo | None
    compliance: Compliance | None
    fitter: Fitter
    base: Fit
    bank: GenericBank
    bank_over_time: GenericBank
    bank_over_torque: GenericBank | None
    parts: tuple[np.ndarray, np.ndarray]
    noise: np.ndarray
    activation_by_emg: bool = False
    reading: TorqueReading = field(default_factory=TorqueReading)

    @property
    def gives_way(self) -> bool:
        """Tell whether the servo gives way so far that torque which no movement causes makes a
        movement that matters.
        """
        return gives_way(self.compliance, self.fitter.rows, self.base)

    @property
    def told_compliance(self) -> Compliance | None:
        """Return how far the servo gives way, where the command or the holds tell it at each
        frequency; None where they do not.
        """
        told = self.servo is not None or (self.compliance is not None and self.compliance.precise)
        return self.compliance if told else None

    @property
    def in_a_loop(self) -> bool:
        """Tell whether the movement may hold torque that no movement causes.

        It may where no command was recorded that would show it, and the servo was never held still
        or gives way by an amount that its holds do not tell well.
        """
        if self.servo is not None:
            return False
        return self.compliance is None or (self.gives_way and not self.compliance.precise)

    def predicted(self, fit: Fit) -> float:
        """Return the share of a model's whitened residual that generic regressors predict on unseen
        rows, the mean of both directions; may be negative.

        Parameters
        ----------
        fit
            The model.
        """
        matrix, (one, other) = self.bank.whitened(), self.parts
        both = ((one, other), (other, one))
        return float(np.mean([cross_score(matrix, fit.residual, *parts) for parts in both]))


def prepare(
    recording: Recording,
    terms: Sequence[str] = PAPER_TERMS,
    progress: Progress = lambda _: None,
    rig: RigFile | None = None,
    found: Fit | None = None,
    compliance: Compliance | None = None,
    reading: TorqueReading | None = None,
) -> Problem:
    """Fit the base model to a recording and learn its noise.

    Parameters
    ----------
    recording
        A usable one.
    terms
        Of the base model.
    progress
        Called with one line for each step.
    rig
        A calibrated one, whose terms are held; None: nothing is known of the rig.
    found
        A model of the recording. Where no command was recorded, the torque that it leaves counts as
        what moved a servo that gives way; None: what the base model leaves.
    compliance
        How far the servo gives way as another recording of the rig tells it, which counts where
        this one does not tell.
    reading
        How the torque sensor reads what acts on the plate; None: as the rig's file has it.
    """
    held: ModelValues = {}
    if rig is not None:
        recording, held = calibrated(recording, rig), held_terms(rig)
        library = term_library()
        turning = [library[name].turned_by for name in held if library[name].turned_by]
        terms = [*terms, *(name for name in (*held, *turning) if name not in terms)]
    progress("finding how the servo follows its command")
    # Torque moves the plate when it acts, and as it acts, not as it is read.
    reading = reading or TorqueReading.of(held)
    acting = replace(recording, torque=reading.acting(recording.torque, recording.rate))
    servo = identify_servo(acting, motion_step(recording))
    motion = motion_of(recording, servo)
    fitter = Fitter.of(motion, coherent_limit(motion), held)
    progress("fitting the base model")
    base = fit_base(fitter, terms)
    clear = clear_limit(fitter, base)
    if clear < fitter.rows.limit:
        fitter = Fitter.of(motion, clear, held)
        base = fit_base(fitter, terms)
    # What the base model does not make of the movement is voluntary torque, and what is missing.
    activation = float(np.mean(motion.torque)) + fitter.rows.slow(base.left, ACTIVATION_HZ)
    by_emg = emg_activation(recording, motion.velocity, activation, motion.rate, ACTIVATION_HZ)
    motion = (
        replace(motion, activation=activation)
        if by_emg is None
        else replace(motion, activation=by_emg, preceding=by_emg)
    )
    given = compliance if compliance is not None and compliance.rate == motion.rate else None
    compliance = _compliance(fitter, found or base, servo, rig, reading, given)
    loop = LoadedServo(recording, servo, compliance, reading)
    fitter, base = fitted_in_loop(loop, fitter.along(motion), terms, base, found)
    bank, parts = GenericBank(fitter.columns), interleaved(fitter.rows)
    if by_emg is None:
        fitter = fitter.along(following(fitter, base)[0])
    fitter = fitter.along(replace(fitter.motion, cocontraction=stiffness_course(fitter, base)))
    noise = base.residual - bank.cross_predicted(base.residual, parts, bank.whitened())
    return Problem(
        recording,
        servo,
        compliance,
        fitter,
        base,
        bank,
        GenericBank(fitter.columns, over="time"),
        # A reflex that varies shows in the EMG of its response, which EMG would then predict.
        _bank_over_torque(fitter) if by_emg is None else None,
        parts,
        noise,
        by_emg is not None,
        reading,
    )


def _compliance(
    fitter: Fitter,
    known: Fit,
    servo: Servo | None,
    rig: RigFile | None,
    reading: TorqueReading,
    given: Compliance | None,
) -> Compliance | None:
    """Return how far the servo gives way: from the command; else from the holds, where these tell
    it at each frequency; else as another recording or the rig's file has it, or as the holds tell
    it roughly.
    """
    if servo is not None:
        return servo.compliance
    motion = fitter.motion
    load, instrument = (
        reading.acting(torque, motion.rate)
        for torque in (motion.torque, not_intrinsic(fitter, known))
    )
    held = held_compliance(motion.position, motion.velocity, load, instrument, motion.rate)
    if held is not None and held.precise:
        return held
    if given is None and rig is not None:
        given = known_compliance(rig, motion.rate)
    return given or held


def not_intrinsic(fitter: Fitter, known: Fit) -> np.ndarray:
    """Return the torque without what joint and rig make of the present movement, as a model has it
    [N.m], shape (n,): reflexes, and what the model leaves.

    Parameters
    ----------
    fitter
        Of the recording.
    known
        The model.
    """
    library = term_library()
    present = {n: v for n, v in known.values.items() if library[n].place not in REFLEX_PLACES}
    return fitter.rows.torque(fitter.evaluate(present).left)


def with_better_course(problem: Problem, final: Fit) -> Problem | None:
    """Return the problem with the torque that the muscles hold, and the course of the stiffness, as
    they are known beside a model; None where the present courses are about as good.

    Friction, say, makes slow torque too, which the base model leaves to the muscles. That torque
    stays as it is where it follows from EMG, or lets no term follow it.

    Parameters
    ----------
    problem
        The present one.
    final
        The model that was found.
    """
    motion, gained = problem.fitter.motion, []
    if not problem.activation_by_emg and motion.preceding is not None:
        held, gain = following(problem.fitter, final)
        gained.append(gain)
        motion = held if gain > BETTER_COURSE else motion
    course, gain = better_course(problem.fitter, final)
    gained.append(gain)
    if max(gained) < BETTER_COURSE:
        return None
    if gain > BETTER_COURSE:
        motion = replace(motion, cocontraction=course)
    fitter = problem.fitter.along(motion)
    bank = None if problem.activation_by_emg else _bank_over_torque(fitter)
    return replace(problem, fitter=fitter, bank_over_torque=bank)


def better_reading(problem: Problem, final: Fit) -> TorqueReading | None:
    """Return how the torque sensor reads what acts on the plate, as a found model tells; None where
    it says nothing new, or where torque does not move the plate in a way that is known.

    A vibration of the sensor, taken for torque that moved the plate, gives it a movement that it
    never made: a mode at 62 Hz was found as one at 60 Hz of a sensor that carries three quarters of
    the load, beside a skew.

    Parameters
    ----------
    problem
        The present one.
    final
        The model that was found.
    """
    if problem.told_compliance is None or not problem.gives_way:
        return None
    told = TorqueReading.of(final.values)
    if is_alignment(problem.fitter, final):
        told = replace(told, late=problem.reading.late)
    before = problem.reading
    earlier = abs(told.late - before.late) < 0.5 * problem.fitter.columns.motion.sample_time
    return None if earlier and told.sensor.keys() == before.sensor.keys() else told


def knows_movement_better(problem: Problem, final: Fit) -> bool:
    """Tell whether a found model tells better than the base model which torque moved the plate.

    What the base model leaves holds missing physics, which the movement did cause. Taken for torque
    that moved the plate it gives the plate a movement that it never made, of a milliradian in a
    human trial.

    Parameters
    ----------
    problem
        The present one.
    final
        The model that was found.

    Returns
    -------
    bool
        False where a command or the holds tell, the servo holds firmly, or the model explains
        little more than the base model.
    """
    compliance = problem.compliance
    if problem.servo is not None or compliance is None:
        return False
    if compliance.precise or not compliance.significant:
        return False
    rows = problem.fitter.rows
    left, before = (float(np.var(rows.torque(fit.left))) for fit in (final, problem.base))
    return left < (1.0 - CLEARER_MOVEMENT) * before


def _bank_over_torque(fitter: Fitter) -> GenericBank | None:
    """Return generic regressors of what the muscles held before each movement; None where
    that is not known.
    """
    if fitter.motion.preceding is None:
        return None
    return GenericBank(fitter.columns, over="preceding torque")


def clear_limit(fitter: Fitter, base: Fit) -> float:
    """Return the highest frequency up to which the position's own noise, seen through the joint, is
    a small part of the residual [Hz].

    Above it the residual would hold the very noise that stands in the regressors, and they would
    seem to predict it.

    Parameters
    ----------
    fitter, base
        The base model's fit.
    """
    rows = fitter.rows
    frequency, left = welch(base.plain[rows.used], rows.rate, nperseg=int(_SEGMENT_S * rows.rate))
    seen = np.abs(Load.of(base).impedance(frequency)) ** 2 * fitter.motion.position_noise(frequency)
    inside = frequency <= rows.limit
    above = frequency[inside & (seen > LARGEST_NOISE_SHARE * left) & (frequency > LOWEST_LIMIT_HZ)]
    return float(above[0]) if len(above) else rows.limit


def coherent_limit(motion: Motion) -> float:
    """Return the highest frequency up to which torque and movement are coherent [Hz], 25 to 80."""
    frequency, alike = coherence(
        motion.acceleration, motion.torque, motion.rate, nperseg=int(_SEGMENT_S * motion.rate)
    )
    both = frequency[(alike > LEAST_COHERENCE) & (frequency < LOW_PASS_HZ)]
    return float(np.clip(both[-1] if len(both) else 0.0, LOWEST_LIMIT_HZ, LOW_PASS_HZ))
