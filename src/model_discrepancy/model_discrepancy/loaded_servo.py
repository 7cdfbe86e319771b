"""The base model of a recording whose servo gives way, and the movement that it is fitted to.

Torque that no movement causes moves the plate of such a servo. A model tells which torque that is,
and the movement without it (`closed_loop`) tells the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ankle_physics.term import term_library
from model_discrepancy.fit.base_model import align
from model_discrepancy.fit.closed_loop import Load, uncaused, undisturbed
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.generic_bank import GenericBank
from model_discrepancy.fit.halves import interleaved
from model_discrepancy.fit.rows import Rows
from model_discrepancy.recording.compliance import Compliance
from model_discrepancy.recording.motion import Motion, motion_of
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.servo import Servo
from model_discrepancy.recording.spectrum import white_density
from model_discrepancy.recording.torque_reading import TorqueReading

# Compliance of the servo times the joint's impedance, where it is largest in the band that is
# fitted: about half the share of a torque that the movement can predict because this torque moved
# the plate. Servos of 2 to 3 kN.m/rad have 0.14 to 0.5, and such torque is named now and then. One
# of 150 kN.m/rad, which gives way measurably, has 0.004 to 0.008; none was named in 42 recordings.
LEAST_LOOP_GAIN = 0.03
# Of movement and model, where friction is among the terms: in two recordings of an independent
# rig the fourth round and the following ones changed K and G by less than 2 %.
_FRICTION_ROUNDS = 3
# Of the base model's whitened error, that dry friction takes off, before a movement is taken to be
# that of a plate with friction. In four recordings of an independent rig with friction it took off
# 88 to 98 %, in 24 with other effects on a servo that gives way at most 55 %.
CLEAR_FRICTION = 0.75
_FRICTION = "coulomb_friction"


@dataclass(frozen=True)
class LoadedServo:
    """Describes how torque moves the plate of a recording.

    Attributes
    ----------
    recording
        As it was read.
    servo
        How it follows its command; None without a command.
    compliance
        How far it gives way; None where nothing tells.
    reading
        How the sensor reads the torque.
    """

    recording: Recording
    servo: Servo | None
    compliance: Compliance | None
    reading: TorqueReading

    @property
    def known(self) -> bool:
        """Tell whether the movement of the servo without a load is known."""
        compliance = self.compliance
        if compliance is None or not compliance.significant:
            return False
        return self.servo is not None or compliance.precise

    def undisturbed(self, measured: Fitter, model: Fit) -> Motion:
        """Return the movement without what torque that no movement causes made of it.

        Parameters
        ----------
        measured
            The problem with the movement as it was measured.
        model
            Tells which torque that is.
        """
        recording, motion, compliance = self.recording, measured.motion, self.compliance
        if compliance is None or not compliance.significant:
            return motion
        noise = 0.0 if self.servo is not None else white_density(recording.torque, recording.rate)
        if self.known:
            if self.servo is not None:
                unloaded = motion_of(recording, self.servo.unloaded())
            else:
                # All torque, and no joint that would answer.
                torque = self.reading.acting(motion.torque, motion.rate)
                unloaded = undisturbed(motion, compliance, torque, Load(), noise)
            disturbance = uncaused(unloaded, measured, measured.evaluate(model.values))
        else:
            disturbance = measured.rows.torque(model.left)
        disturbance = self.reading.acting(disturbance, motion.rate)
        return undisturbed(motion, compliance, disturbance, Load.of(model), noise)


def gives_way(compliance: Compliance | None, rows: Rows, base: Fit) -> bool:
    """Tell whether the servo gives way so far that torque which no movement causes makes a movement
    that matters.

    Parameters
    ----------
    compliance
        Of the servo; None where nothing tells.
    rows
        Whose band is fitted.
    base
        The base model's fit.
    """
    if compliance is None or not compliance.significant:
        return False
    frequency = rows.frequency[rows.frequency <= rows.limit]
    gain = compliance.response(frequency) * Load.of(base).impedance(frequency)
    return bool(np.abs(gain).max() > LEAST_LOOP_GAIN)


def fitted_in_loop(
    loop: LoadedServo, measured: Fitter, terms: Sequence[str], base: Fit, found: Fit | None
) -> tuple[Fitter, Fit]:
    """Return the problem with the movement that the model is fitted to, whitened, and the base
    model's fit there.

    Dry friction holds a plate that rests, against torque that would move it. Where the base model
    has none and friction explains nearly all that it leaves, the movement is that of a plate with
    this friction; the search names it.

    Parameters
    ----------
    loop
        How torque moves the plate.
    measured
        The problem with the movement as it was measured.
    terms
        Of the base model.
    base
        Its fit to that movement.
    found
        A model of the recording; None where nothing is known yet.
    """
    if found is not None:
        fitter = measured.along(loop.undisturbed(measured, found))
        return fitter, _whitened(fitter, terms, base)
    fitter, fit = _in_turns(loop, measured, terms, base)
    if not loop.known or Load.of(fit).friction or not gives_way(loop.compliance, fitter.rows, fit):
        return fitter, fit
    turning = term_library()[_FRICTION].turned_by
    # With whitening of its own, so that both have the same one in the comparison.
    apart = Fitter.of(measured.motion, measured.rows.limit, measured.held)
    dry, beside = _in_turns(loop, apart, [*terms, _FRICTION, turning], base)
    used = fitter.rows.used
    left = float(np.var(fitter.rows.whitened(beside.left)[used]))
    if left > (1.0 - CLEAR_FRICTION) * float(np.var(fit.residual[used])):
        return fitter, fit
    return dry, _whitened(dry, terms, base)


def _in_turns(
    loop: LoadedServo, measured: Fitter, terms: Sequence[str], first: Fit
) -> tuple[Fitter, Fit]:
    """Fit these terms and the movement, from a first fit, in turns where there is friction."""
    model = first
    library = term_library()
    dry = loop.known and any(library[name].rest_torque for name in terms)
    for _ in range(_FRICTION_ROUNDS if dry else 1):
        fitter = measured.along(loop.undisturbed(measured, model))
        model = _whitened(fitter, terms, model)
    return fitter, model


def _whitened(fitter: Fitter, terms: Sequence[str], first: Fit) -> Fit:
    """Fit these terms from a first fit, whitened by the noise beside them."""
    bank, parts = GenericBank(fitter.columns), interleaved(fitter.rows)
    fit = fitter.fit(terms, first.values, evaluations=15)
    fitter.whiten_by(fit.plain - bank.cross_predicted(fit.plain, parts))
    return align(fitter, fitter.fit(terms, fit.values))
