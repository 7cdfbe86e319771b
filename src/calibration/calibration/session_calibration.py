"""A minute of perturbation gives ``subject.yaml``, the model of this subject in this session."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ankle_physics.joint_profile import joint_in_force
from ankle_physics.model import PAPER_TERMS, TERMS_OF_GAINS, Model, StatedAt, StatedValue
from ankle_physics.rig_agreement import rig_warnings
from ankle_physics.rig_file import RigFile
from ankle_physics.term import Place, term_library
from calibration.errors import CalibrationError
from impedance_estimator.estimator import ESTIMATE_COLUMNS
from impedance_estimator.known_physics import LEAST_STIFFNESS, KnownPhysics
from impedance_estimator.offline.recorded_estimates import estimate_signal
from impedance_estimator.simultaneous.doubt import DOUBT_THRESHOLD, imprecision
from model_discrepancy.diagnose import diagnose
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.recording.known_rig import SKEW
from model_discrepancy.recording.recording import Recording
from model_discrepancy.report.result_folder import AUGMENTED_FILE

LEAST_GAIN = 1.0
"""[N.m.s/rad] Bounds a relative error of G: a subject with less has hardly a reflex."""
MOST_OF_ERROR = 0.5
"""[1] A model that explains a recording and takes off so much of the error that the paper's model
leaves is never refused. Of 72 sessions of an independent rig three such models would have been,
with K and G up to 15 % off; without them G was off by up to 112 %, with a standard error of 12 %.
One that takes off less and leaves the recording unexplained is always refused. With five such
models, of stated errors that would not have had them refused, K was up to 34 % off and G up to
22 %; without them 1 and 10 %.
"""


@dataclass(frozen=True)
class CalibratedSession:
    """Holds a calibrated session.

    Attributes
    ----------
    model
        What is written to ``subject.yaml``.
    verdict
        The keys ``verdict``, ``effects`` and ``parameters`` of ``verdict.json``.
    error_cut
        Share of the whitened error of the paper's model that the found terms take off, 0...1.
    """

    model: Model
    verdict: dict[str, Any]
    error_cut: float = 0.0

    @property
    def explains_most(self) -> bool:
        """Tell whether the model explains the recording, and most of what the paper's model
        leaves.
        """
        return self.verdict["verdict"] == "explained" and self.error_cut >= MOST_OF_ERROR


def calibrate_session(
    source: Recording | Path | str,
    folder: Path | str,
    rig: RigFile | None = None,
    progress: Callable[[str], None] = lambda _: None,
    at_most: float | None = None,
) -> CalibratedSession:
    """Diagnose a recording and make the subject's model of what was found.

    Parameters
    ----------
    source
        A recording or a bag: 60 to 120 s of perturbation on the subject at rest or at a constant
        torque.
    folder
        Receives the diagnosis with its report.
    rig
        The calibrated rig, which is taken as known, so that only what it does not explain is
        diagnosed; None: everything that is found of the rig goes into the subject's model.
    progress
        Called with the present step.
    at_most
        Time after which the diagnosis adds no further terms [min]; None for no limit.

    Raises
    ------
    CalibrationError
        The recording is a bad one, or nobody's foot is on the plate; says why.
    session_recorder.errors.BagError
        No such bag or topic.
    """
    out = Path(folder)
    recording = source if isinstance(source, Recording) else read_session(source)
    library = session_library(rig)
    found = diagnose(recording, out, library=library, progress=progress, rig=rig, at_most=at_most)
    verdict = found.verdict
    if verdict.verdict == "bad_recording" or found.found is None:
        reasons = "; ".join(verdict.reasons) or "bad recording"
        raise CalibrationError(f"{recording.name} cannot calibrate a session: {reasons}")
    model = subject_model(Model.load(out / AUGMENTED_FILE), f"subject of {recording.name}", rig)
    model.stated = stated_values(verdict.parameters)
    require_subject(model, verdict.parameters, recording.name)
    assert found.problem is not None
    motion = found.problem.fitter.motion
    position, torque = float(np.mean(motion.position)), float(np.mean(motion.torque))
    model.stated_at = StatedAt(position, torque, 0.5 * len(motion.position) / motion.rate)
    return CalibratedSession(
        model,
        {
            "verdict": verdict.verdict,
            "effects": verdict.effects,
            "parameters": verdict.parameters,
        },
        found.found.cut,
    )


def read_session(bag: Path | str) -> Recording:
    """Return the recording of a session.

    Parameters
    ----------
    bag
        Holds ``/ankle/samples``.

    Raises
    ------
    CalibrationError
        A topic or a channel is missing, or the samples are too few.
    session_recorder.errors.BagError
        There is no such bag.
    """
    try:
        return Recording.from_bag(bag)
    except DiagnosisError as error:
        raise CalibrationError(f"{bag} cannot calibrate a session: {error}") from None


def rig_contradictions(recording: Recording, rig: RigFile) -> list[str]:
    """Return one sentence for each way in which a rig file contradicts a recording.

    The checks are those of the running estimator (`ankle_physics.rig_agreement`), except for the
    age of the file: an old file is none of another rig.

    Parameters
    ----------
    recording
        Of the perturbed subject, as it was measured.
    rig
        The rig file that is to be taken as known.
    """
    part = recording.longest_stretch()
    if not all(np.isfinite(values).all() for values in part.channels().values()):
        return []  # the diagnosis refuses such a recording, and says why
    return rig_warnings(
        rig, part.rate, part.position, part.velocity, part.torque, now=rig.calibrated
    )


def require_subject(
    model: Model, parameters: Mapping[str, Mapping[str, float | None]], name: str
) -> None:
    """Refuse a model with less inertia or stiffness than the joint in force can have.

    Parameters
    ----------
    model
        The subject's model.
    parameters
        The ``parameters`` of the verdict. An effective stiffness counts as stiffness, too.
    name
        Of the recording.

    Raises
    ------
    CalibrationError
        No foot was on the plate, or the torque has another unit; names value, unit and the least
        plausible value.
    """
    joint = joint_in_force()
    found = []
    if model.has("stiffness"):
        stated = [
            float(given["augmented"] or 0.0)
            for key, given in parameters.items()
            if key.split("[")[0] in ("K", "K_effective")
        ]
        stiffness = max(stated or [_value(model, "stiffness", "K")])
        found.append(("K", stiffness, LEAST_STIFFNESS * joint.scale("N.m/rad"), "N.m/rad"))
    if model.has("inertia"):
        inertia = _value(model, "inertia", "I")
        found.append(("I", inertia, joint.inertia_range[0], "kg.m^2"))
    for symbol, value, least, unit in found:
        if value < least:
            unit = joint.in_units(unit)
            raise CalibrationError(
                f"{name} cannot calibrate a session: {symbol} = {value:.3g} {unit} is less than "
                f"{least:g} {unit}, the least plausible value of the joint '{joint.name}'; is "
                "anybody on the plate, and is the torque in the right unit?"
            )


def _value(model: Model, term: str, symbol: str) -> float:
    return float(model.entry(term).values[symbol])


def session_library(rig: RigFile | None) -> list[str]:
    """Return the terms that the diagnosis of a session may add.

    Terms that follow the torque of the muscles are not among them: K and G follow it themselves
    (`KnownPhysics`), and the others are to be right without.

    A rig that a recording calibrated was looked at with its plate empty, where whatever acts at the
    torque sensor shows as well. What the rig's file does not state of the sensor is not there:
    such a term would stand for what only a foot brings along, such as straps.

    Parameters
    ----------
    rig
        The calibrated rig; None: nothing is known of the rig.
    """
    kept = {n: term for n, term in term_library().items() if not term.follows_torque}
    if rig is None or not rig.bag:
        return list(kept)
    return [n for n, term in kept.items() if term.place is not Place.TORQUE_SENSOR]


def require_gain(
    found: CalibratedSession, recording: Recording, rig: RigFile | None = None
) -> None:
    """Refuse a subject's model with which K and G would be known less well than without it.

    Terms that share what they explain leave K and G open. The standard errors that the diagnosis
    states of the whole joint say so, and those of the online estimate without the model, which hold
    what a doubted estimate usually is off by, are what they are compared with: in N.m/rad and
    N.m.s/rad, as both know the same joint. A model whose estimates would not be doubted, or that
    explains most of the error (`MOST_OF_ERROR`), is never refused. One that leaves the recording
    unexplained and explains little always is: the equations that were found are not those of the
    subject, and bend K and G as they bend themselves.

    Parameters
    ----------
    found
        Of `calibrate_session`.
    recording
        That it was made of.
    rig
        The calibrated rig, which both know.

    Raises
    ------
    CalibrationError
        The estimator should go on without the model.
    """
    if found.verdict["verdict"] == "unexplained" and found.error_cut < MOST_OF_ERROR:
        raise CalibrationError(
            f"{recording.name} cannot calibrate a session: it is 'unexplained', and the terms that "
            f"were found take off {100.0 * max(found.error_cut, 0.0):.1f} % of the error that the "
            f"paper's model leaves, less than {100.0 * MOST_OF_ERROR:.0f} %, so that the estimator "
            "goes on without them; the report says what is missing"
        )
    model = found.model
    known = KnownPhysics(rig, model)
    if known.calibration_doubt < DOUBT_THRESHOLD or found.explains_most:
        return
    plain = estimate_signal(
        recording.time,
        recording.position,
        recording.velocity,
        recording.torque,
        reference=recording.reference,
        known=KnownPhysics(rig) if rig is not None else None,
    ).valid
    if not len(plain):
        return
    K, G, error_K, error_G = (
        float(plain[-1, ESTIMATE_COLUMNS.index(name)])
        for name in ("K[N.m/rad]", "G[N.m.s/rad]", "se_K[N.m/rad]", "se_G[N.m.s/rad]")
    )
    stiffness, gain = model.stated["K"], model.stated.get("G", StatedValue(0.0, 0.0))
    # Relative to its own value, the estimate that is too high would seem the better known one.
    larger_K = max(abs(K), abs(stiffness.value), LEAST_STIFFNESS)
    larger_G = max(abs(G), abs(gain.value), LEAST_GAIN)
    with_it = stiffness.standard_error / larger_K, gain.standard_error / larger_G
    without = error_K / larger_K, error_G / larger_G
    if imprecision(*with_it) > imprecision(*without):
        raise CalibrationError(
            f"{recording.name} cannot calibrate a session: with the terms that were found the "
            f"standard error is {100.0 * with_it[0]:.0f} % of K and {100.0 * with_it[1]:.0f} % of "
            f"G, without them {100.0 * without[0]:.0f} and {100.0 * without[1]:.0f} %, so that the "
            "estimator goes on without them; record longer, or another movement, which 'ankle "
            "design-experiment' proposes from the report"
        )


def subject_model(diagnosed: Model, title: str, rig: RigFile | None = None) -> Model:
    """Return the part of a diagnosed model that the estimator has to know beside the rig's file.

    Parameters
    ----------
    diagnosed
        As the diagnosis writes it.
    title
        Free text of the new model.
    rig
        Its terms are left to it; None: what was found of the rig stays in the model, as nothing
        else would undo it.

    Returns
    -------
    Model
        Inertia, viscosity, stiffness and reflex follow the subject from moment to moment and are
        marked as tracked.
    """
    known = set() if rig is None else {SKEW, *(entry.term.name for entry in rig.model.entries)}
    entries = [
        copy.deepcopy(entry)
        for entry in diagnosed.entries
        if entry.term.name not in known and entry.term.place is not Place.ACTIVATION
    ]
    for entry in entries:
        entry.tracked = entry.term.name in PAPER_TERMS
    return Model(entries, title)


def stated_values(parameters: Mapping[str, Mapping[str, float | None]]) -> dict[str, StatedValue]:
    """Return K and G of the whole joint, with standard errors, as a diagnosis states them.

    The errors of single parameters do not say this: those of terms that share a torque are
    correlated, and none holds what the value owes to the choice of terms.

    Parameters
    ----------
    parameters
        The ``parameters`` of the verdict.
    """
    found = {}
    for key, given in parameters.items():
        symbol, error = key.split("[")[0], given.get("standard_error")
        value = given.get("augmented")
        if symbol in TERMS_OF_GAINS and value is not None and error is not None:
            found[symbol] = StatedValue(float(value), float(error))
    return found
