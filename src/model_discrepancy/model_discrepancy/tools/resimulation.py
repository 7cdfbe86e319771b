"""A recording's own movement through the simulation, with and without the new physics, against what
was recorded.

The models run in the time domain, term by term, as in `ankle_sim`; nothing is fitted here. So this
also checks the diagnosis, which works on spectra.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.interpolate import make_interp_spline
from scipy.signal import resample_poly

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.model import Model
from ankle_physics.rig_file import RigFile
from ankle_physics.signals import Signals
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.fit.base_model import ALIGNMENT
from model_discrepancy.fit.columns import Columns
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.held_out import vaf
from model_discrepancy.fit.held_torque import held_torque, shown_share
from model_discrepancy.fit.rows import Rows
from model_discrepancy.fit.stiffness_course import COCONTRACTION, stiffness_course
from model_discrepancy.recording.channel_gains import channel_findings, trusted
from model_discrepancy.recording.emg_activation import emg_activation
from model_discrepancy.recording.known_rig import calibrated
from model_discrepancy.recording.motion import ACTIVATION_HZ, Motion, motion_of, motion_step
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.servo import identify_servo
from model_discrepancy.report.plain_words import vaf_text
from model_discrepancy.report.result_folder import AUGMENTED_FILE, BASE_FILE, RIG_FILE
from model_discrepancy.tools.known_terms import load_model
from model_discrepancy.tools.written_bag import write_bag

_SHOWN_S = 3.0
# [Hz] A foot that strikes stops is off by 4 % of its torque where the simulation sees it at 500 Hz,
# as the fit does, which takes finer steps of its own; at this rate by 0.3 %.
COUPLED_RATE_HZ = 2000.0


@dataclass(frozen=True)
class Resimulation:
    """Holds the torque of both models on the recorded movement.

    Attributes
    ----------
    recording
        What was recorded.
    torque
        Simulated torque [N.m] by "base" and "augmented", each of shape (n,), at the recording's
        rate.
    vaf
        VAF [%] of each, 0.1 to 80 Hz, over the whole recording.
    time
        Of the rows [s], shape (rows,).
    rows
        Recorded and simulated torque [N.m], 0.1 to 80 Hz, by "recorded", "base" and "augmented",
        each of shape (rows,).
    """

    recording: Recording
    torque: dict[str, np.ndarray]
    vaf: dict[str, float]
    time: np.ndarray
    rows: dict[str, np.ndarray]

    def save(self, out: Path) -> None:
        """Write one bag for each model, and a picture, into a folder."""
        for name, torque in self.torque.items():
            # The movement is the recorded one, and follows no command of the simulation.
            moved = replace(self.recording, reference=None)
            write_bag(moved, torque, out / f"{name}_bag")
        self._picture().savefig(out / "resimulation.png", dpi=110)

    def _picture(self) -> Figure:
        figure = Figure(figsize=(10, 4.5), layout="constrained")
        axes = figure.subplots()
        middle = 0.5 * self.time[-1]
        shown = (self.time >= middle) & (self.time < middle + _SHOWN_S)
        for name, style in (("recorded", "k"), ("base", "C3"), ("augmented", "C0")):
            share = "" if name == "recorded" else f", VAF {vaf_text(self.vaf[name])} %"
            axes.plot(
                self.time[shown],
                self.rows[name][shown],
                style,
                lw=2 if name == "recorded" else 1.2,
                label=name + share,
            )
        axes.set_xlabel("time into the recording [s]")
        axes.set_ylabel("torque, 0.1 to 80 Hz [N.m]")
        axes.set_title(f"{self.recording.name}: its own movement, simulated")
        axes.legend()
        return figure


def resimulate(recording: Recording, base: Model, augmented: Model) -> Resimulation:
    """Run both models on the recorded movement.

    Parameters
    ----------
    recording
        A usable one.
    base, augmented
        As `diagnose` writes them.
    """
    # The movement that the diagnosis fitted with, its channels corrected alike.
    servo = identify_servo(recording, motion_step(recording))
    corrected = trusted(recording, channel_findings(recording, servo))
    motion = motion_of(corrected, identify_servo(corrected, motion_step(corrected)))
    rows = Rows(len(motion.position), motion.rate)
    recorded = rows.spectrum(motion.torque)
    # Activation is EMG, or the slow torque that movement does not make, as in the diagnosis.
    steady = Model([e for e in augmented.entries if not e.term.follows_torque])
    left = rows.torque(recorded - rows.spectrum(simulated_torque(steady, motion)))
    held = held_torque(Columns(motion, rows), left, _shown(augmented, motion))
    slow = float(np.mean(motion.torque)) + held
    by_emg = emg_activation(corrected, motion.velocity, slow, motion.rate, ACTIVATION_HZ)
    motion = replace(motion, activation=slow if by_emg is None else by_emg)
    motion = replace(motion, cocontraction=_stiffness_course(augmented, motion))
    plain, torque, shares = {"recorded": rows.plain(recorded)}, {}, {}
    step = round(recording.rate / motion.rate)
    for name, model in (("base", base), ("augmented", augmented)):
        made = simulated_torque(model, motion)
        plain[name] = rows.plain(rows.spectrum(made))
        shares[name] = vaf(
            plain["recorded"][rows.used], (plain["recorded"] - plain[name])[rows.used]
        )
        torque[name] = resample_poly(made, step, 1, padtype="line")[: len(recording.torque)]
    return Resimulation(recording, torque, shares, rows.time, plain)


def _shown(model: Model, motion: Motion) -> np.ndarray:
    """Return the share of the muscles' torque that a model's joint shows, shape (n,)."""
    if not model.has("activation_stiffness"):
        return np.ones(len(motion.position))
    values = model.entry("activation_stiffness").values
    return shown_share(motion.position, values["ka"], values["xc"])


def _stiffness_course(model: Model, motion: Motion) -> np.ndarray | None:
    """Return the course of the stiffness beyond a model's, shape (n,), where the model has it."""
    if not model.has(COCONTRACTION):
        return None
    fitter = Fitter.of(motion)
    values = {e.term.name: {s: float(v) for s, v in e.values.items()} for e in model.entries}
    fitter.whiten_by(fitter.evaluate(values).plain)
    return stiffness_course(fitter, fitter.evaluate(values))


def simulated_torque(model: Model, motion: Motion) -> np.ndarray:
    """Return the torque [N.m] of a model on a movement as it was read, shape (n,), at the motion's
    rate.

    A model whose torque is read earlier than the position delays the position. Here the position
    stays as it was read, so that the torque comes earlier.

    Parameters
    ----------
    model
        A foot behind a compliant coupling is simulated at `COUPLED_RATE_HZ` or just above.
    motion
        That drives it, of n samples.

    Raises
    ------
    ModelError
        The motion of the foot has no solution.
    """
    skew = model.entry(ALIGNMENT).values["skew"] if model.has(ALIGNMENT) else 0.0
    at_once = Model([entry for entry in model.entries if entry.term.name != ALIGNMENT])
    course = (
        np.zeros(len(motion.position)) if motion.cocontraction is None else motion.cocontraction
    )
    channels = (motion.position, motion.velocity, motion.acceleration, motion.activation, course)
    samples = np.arange(len(motion.position), dtype=float)
    coupled = any(isinstance(entry.term, CompliantCoupling) for entry in model.entries)
    steps = math.ceil(COUPLED_RATE_HZ / motion.rate) if coupled else 1
    fine = np.arange((len(samples) - 1) * steps + 1) / steps
    driven = (
        make_interp_spline(samples, c, k=3)(fine) if steps > 1 else c.copy() for c in channels
    )
    torque = at_once.torque(Signals(steps * motion.rate, *driven))[::steps]
    if skew == 0.0:
        return torque
    shifted = np.clip(samples - skew * motion.rate, 0.0, samples[-1])
    return np.asarray(make_interp_spline(samples, torque, k=5)(shifted))


def resimulate_bag(bag: Path, diagnosis: Path, out: Path) -> Resimulation:
    """Resimulate a bag from the folder of its diagnosis and write the result to `out`.

    Raises
    ------
    DiagnosisError
        The folder holds no models: the diagnosis found the recording unusable. Or a model names a
        term that the library lacks.
    BagError
        No such bag.
    ModelError
        A model file cannot be read.
    """
    for name in (BASE_FILE, AUGMENTED_FILE):
        if not (diagnosis / name).exists():
            raise DiagnosisError(
                f"{diagnosis} holds no {name}; `ankle diagnose` writes it for every usable "
                "recording"
            )
    base, augmented = load_model(diagnosis / BASE_FILE), load_model(diagnosis / AUGMENTED_FILE)
    with augmented.joint.in_force():
        recording = Recording.from_bag(bag)
        if (diagnosis / RIG_FILE).exists():
            recording = calibrated(recording, RigFile.load(diagnosis / RIG_FILE))
        result = resimulate(recording, base, augmented)
        out.mkdir(parents=True, exist_ok=True)
        result.save(out)
    return result
