"""A simulated subject on the virtual rig: reference in; samples, EMG and session events out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ankle_node.session_event import HOLD_ENDED, HOLD_STARTED, TORQUE_TARGET, SessionEvent
from ankle_physics.model import Model
from ankle_physics.surface_emg import SurfaceEmg
from ankle_sim.live_rig import LiveRig, Setup, Stretch
from ankle_sim.parameters import VOLUNTARY_TORQUE
from ankle_sim.procedure import PlannedHold
from ankle_sim.virtual_subject import Drive, State, Subject, VirtualSubject

SUBJECT_PARAMETER_SYMBOLS = (("stiffness", "K"), ("reflex", "G"), (VOLUNTARY_TORQUE, "level"))
"""Lists the parameters that the subject sets in the model: term and symbol."""


def subject_model(subject: Subject, rms: float = 0.5) -> Model:
    """Return the paper's model with the subject's I and B, and a voluntary torque.

    Parameters
    ----------
    subject
        The simulated subject.
    rms
        Size of the slow drift of the voluntary torque [N.m].
    """
    return Model.of(
        {
            "inertia": {"I": subject.I},
            "viscosity": {"B": subject.B},
            "stiffness": {"K": subject.K_rest},
            "reflex": {},
            VOLUNTARY_TORQUE: {"level": 0.0, "rms": rms},
        },
        subject.name,
    )


@dataclass(frozen=True)
class Piece:
    """Holds uninterrupted samples of rig and electrodes.

    Attributes
    ----------
    stretch
        Of the rig.
    emg
        [V], shape (n, 4), muscles SOL, TA, GL, GM.
    """

    stretch: Stretch
    emg: np.ndarray


class LiveSubject:
    """Turns reference blocks into samples, EMG and session events.

    Parameters
    ----------
    setup
        The rig; its model needs stiffness, reflex and voluntary torque.
    subject
        The simulated subject.
    holds
        That the subject goes through; without any the state changes by `command` alone.
    report
        Called with a sentence when something happens that an operator should know.
    noisy
        Whether the rig's samples have noise.
    steady
        See `VirtualSubject`.

    Raises
    ------
    ModelError
        The model lacks a term, or a scenario determines what the subject determines.

    Attributes
    ----------
    rig
        The rig.
    drive
        What the subject does now.
    """

    def __init__(
        self,
        setup: Setup,
        subject: Subject,
        holds: Sequence[PlannedHold],
        report: Callable[[str], None],
        noisy: bool = True,
        steady: bool = False,
    ) -> None:
        self.rig = LiveRig(setup, report, noisy)
        self._virtual = VirtualSubject(subject, setup.seed, steady)
        self._fixed: dict[tuple[str, str], float] = {}
        self.drive: Drive = self._virtual.command(State())
        self._drive_rig()
        self._seed = setup.seed
        self._emg: SurfaceEmg | None = None
        self._start: float | None = None
        self._ahead: list[tuple[float, PlannedHold, str]] = []
        for hold in holds:
            self._ahead += [
                (hold.reach, hold, ""),
                (hold.start, hold, HOLD_STARTED),
                (hold.end, hold, HOLD_ENDED),
            ]
        self._ahead.sort(key=lambda entry: entry[0])

    def command(self, state: State) -> None:
        """Let the subject go to a new state, which ends what `fix` keeps."""
        self._fixed.clear()
        self._virtual.command(state)

    def fix(self, term: str, symbol: str, value: float) -> None:
        """Keep a parameter at a value, whatever the muscles do, until the next state.

        It is one of `SUBJECT_PARAMETER_SYMBOLS`. The EMG stays that of the muscles.

        Raises
        ------
        ModelError
            Out of range.
        """
        self.rig.set(term, symbol, value)
        self._fixed[term, symbol] = value

    def take(
        self, time: np.ndarray, reference: np.ndarray
    ) -> tuple[list[Piece], list[SessionEvent]]:
        """Simulate one block.

        Parameters
        ----------
        time
            Times of the samples [s], shape (n,).
        reference
            See `LiveRig.take`.

        Raises
        ------
        ModelError
            As `LiveRig.take`.
        """
        events = self._follow_procedure(time)
        pieces = []
        stretches = self.rig.take(time, reference)
        for stretch in stretches:
            if self._emg is None or self._emg.rate != self.rig.rate:
                assert self.rig.rate is not None
                self._emg = SurfaceEmg(self.rig.rate, self._seed)
            pieces.append(
                Piece(
                    stretch,
                    self._emg.run(stretch.clean[:, 1], self.drive.background, self.drive.burst),
                )
            )
        if self.rig.rate:
            self.drive = self._virtual.advance(
                sum(len(stretch.time) for stretch in stretches) / self.rig.rate
            )
            self._drive_rig()
        return pieces, events

    def _drive_rig(self) -> None:
        values = (self.drive.K, self.drive.G, self.drive.torque)
        for (term, symbol), value in zip(SUBJECT_PARAMETER_SYMBOLS, values, strict=True):
            self.rig.set(term, symbol, self._fixed.get((term, symbol), value))

    def _follow_procedure(self, time: np.ndarray) -> list[SessionEvent]:
        """Set out for the next state, or begin or end a hold, when its time has come."""
        known = time[np.isfinite(time)]
        if not len(known):
            return []
        if self._start is None:
            self._start = float(known[0])
        events = []
        while self._ahead and self._start + self._ahead[0][0] <= known[-1]:
            at, hold, event = self._ahead.pop(0)
            if event:
                events.append(
                    SessionEvent(
                        event, self._start + at, {"hold": hold.number, TORQUE_TARGET: hold.target}
                    )
                )
            else:
                self.command(hold.state)
        return events
