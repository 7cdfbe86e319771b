"""A plate behind a servo that gives way: its motion depends on the torque, and the torque on it.

Equation, with the servo's natural frequency w, damping z, stiffness k_a, the command x and the
torque T of plate and joint::

    y'' + 2 z w y' + w^2 y = w^2 (x - T / k_a),    T = I y'' + B y' + K y + other

Inertia, viscosity and stiffness are solved together with the servo, exactly for inputs that are
linear between samples. ``other`` is found by waveform relaxation over short windows, as in
`ankle_physics.foot_loop`; it comes late (reflex) or is small, so that few rounds suffice. Dry
friction of a plate that hardly moves is as steep as a strong damping; its slope at a window's begin
is solved with the viscosity. A window that does not converge, since the torque jumps where play or
friction reverses, is halved, down to a `single_sample`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ankle_physics.actuator import Servo
from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.errors import ModelError
from ankle_physics.linear_dynamics import SecondOrder
from ankle_physics.model import Entry
from ankle_physics.model_run import ModelRun
from ankle_physics.signals import Signals
from ankle_physics.single_sample import torque_between

# Shorter than the shortest reflex delay, so that a window's reflex is known when it begins.
WINDOW = 0.016  # s
# Windows converge in four to eight rounds; one that needs far more is cheaper in halves.
MOST_ROUNDS = 20
# Of the torque, or of 1 N.m where it is smaller; far below any sensor's resolution.
TOLERANCE = 1e-9
# Parts of the steepest slope, to which the one that is solved with the viscosity is rounded: the
# matrix of each is computed once, and a window converges as well.
DRAG_STEPS = 8
# Rounds that settle the plate under its first load.
SETTLING_ROUNDS = 50


class ServoLoop:
    """Computes plate and joint together, stretch by stretch, from rest under load.

    Parameters
    ----------
    servo
        Of the actuator; not ideal.
    stiffness
        Stiffness k_a of the servo [N.m/rad].
    rate
        Internal rate [Hz].
    run
        The model on its way; advanced by this loop alone.
    entries
        Terms of the model whose values the run uses; arrays cover the whole stretch.

    Raises
    ------
    ModelError
        An ideal servo, which has no dynamics to give way with.
    """

    def __init__(
        self, servo: Servo, stiffness: float, rate: float, run: ModelRun, entries: list[Entry]
    ) -> None:
        if servo.ideal:
            raise ModelError(
                "a servo with 'servo_compliance' needs a bandwidth; 0 Hz is an ideal actuator"
            )
        self._omega = 2.0 * math.pi * servo.bandwidth
        self._damping = servo.damping
        self._stiffness = stiffness
        self._rate = rate
        self._run = run
        self._entries = entries
        self._dynamics: SecondOrder | None = None
        self._other = 0.0
        self._drag = 0.0

    def run(self, command: np.ndarray) -> tuple[Signals, dict[str, np.ndarray]]:
        """Move the plate along a command.

        Parameters
        ----------
        command
            Angle [rad] at the internal rate, shape (n,).

        Returns
        -------
        tuple[Signals, dict[str, np.ndarray]]
            All signals of the stretch, and the torque [N.m] of each term, shape (n,) each.

        Raises
        ------
        ModelError
            The motion has no solution.
        """
        values = [dict(entry.values) for entry in self._entries]
        motion = np.empty((3, len(command)))
        torque, measured = np.empty(len(command)), np.empty((2, len(command)))
        parts: dict[str, np.ndarray] = {}
        longest = length = max(1, round(WINDOW * self._rate))
        start = 0
        try:
            while start < len(command):
                part = slice(start, min(start + length, len(command)))
                for entry, own in zip(self._entries, values, strict=True):
                    entry.values.update(_sliced(own, part))
                if self._dynamics is None:
                    self._settle(float(command[0]))
                # A window that does not converge may run away.
                with np.errstate(over="ignore", invalid="ignore"):
                    signals = self._window(command[part])
                if signals is None:
                    length = (part.stop - start) // 2
                    continue
                motion[:, part] = signals.position, signals.velocity, signals.acceleration
                torque[part] = signals.torque
                measured[:, part] = signals.measured_position, signals.measured_velocity
                for name, own_torque in self._run.parts.items():
                    parts.setdefault(name, np.empty(len(command)))[part] = own_torque
                start, length = part.stop, min(2 * length, longest)
        finally:
            for entry, own in zip(self._entries, values, strict=True):
                entry.values.update(own)
        whole = Signals(self._rate, motion[0], motion[1], motion[2])
        whole.torque = torque
        whole.measured_position, whole.measured_velocity = measured
        return whole, parts

    def _window(self, command: np.ndarray) -> Signals | None:
        """Return all signals of a window, after which the run goes on; None where a window of
        several samples does not converge.

        Raises
        ------
        ModelError
            A single sample has no solution.
        """
        assert self._dynamics is not None
        self._follow_drag()
        before, at_rest = self._run.snapshot(), self._dynamics.state
        other = np.full(len(command), self._other)
        for _ in range(MOST_ROUNDS):
            signals, answer, close = self._answer(other, command)
            if np.abs(answer - other).max() <= close:
                self._other = float(answer[-1])
                return signals
            if not np.isfinite(answer).all():
                break
            other = answer
            self._resume(before, at_rest)
        self._resume(before, at_rest)
        return self._sample(command) if len(command) == 1 else None

    def _sample(self, command: np.ndarray) -> Signals:
        """Return all signals of one sample, whose torque lies between those of two rounds."""
        assert self._dynamics is not None
        before, at_rest = self._run.snapshot(), self._dynamics.state

        def ahead(torque: float) -> float:
            self._resume(before, at_rest)
            return float(self._answer(np.array([torque]), command)[1][0]) - torque

        solved = torque_between(ahead, self._other, TOLERANCE)
        if solved is None:
            raise ModelError(
                f"the plate's motion does not converge on a servo of {self._stiffness:g} N.m/rad: "
                "a term is too steep for it"
            )
        self._resume(before, at_rest)
        signals, _, _ = self._answer(np.array([solved]), command)
        self._other = solved
        return signals

    def _resume(self, before: Any, at_rest: tuple[float, float, float]) -> None:
        """Take run and plate back to where a window begins."""
        assert self._dynamics is not None
        self._run.restore(before)
        self._dynamics.resume(*at_rest)

    def _answer(self, other: np.ndarray, command: np.ndarray) -> tuple[Signals, np.ndarray, float]:
        """Return the signals that a torque beside the linear one [N.m], shape (n,), makes of a
        window, the torque that the terms then have beside it, and how close both should be [N.m].
        """
        assert self._dynamics is not None
        inertia, viscosity, stiffness = self._linear()
        share = self._omega**2 / self._stiffness
        mass = 1.0 + share * inertia
        omega = math.sqrt((self._omega**2 + share * stiffness) / mass)
        damping = (2.0 * self._damping * self._omega + share * viscosity) / (2.0 * omega * mass)
        gain = self._stiffness / (self._stiffness + stiffness)
        x, v, a = self._dynamics.run_with_rates(
            gain * (command - other / self._stiffness), omega, damping
        )
        signals = Signals(self._rate, x, v, a)
        self._run.torque(signals)
        total = sum(self._run.parts.values(), np.zeros(len(x)))
        answer = total - inertia * a - viscosity * v - stiffness * x
        return signals, answer, TOLERANCE * max(1.0, float(np.abs(total).max()))

    def _linear(self) -> tuple[float, float, float]:
        """Return inertia, viscosity, stiffness that are solved with the servo; behind a compliant
        coupling the coupling's own.
        """
        own = {entry.term.name: entry for entry in self._entries}

        def value(term: str, symbol: str) -> float:
            return float(np.ravel(own[term].values[symbol])[0]) if term in own else 0.0

        plate = value("footplate_inertia", "Ip")
        for entry in self._entries:
            if isinstance(entry.term, CompliantCoupling):
                k, b = entry.term.linearised(entry.values)
                return plate, b + self._drag, k
        inertia = plate + value("inertia", "I")
        return inertia, value("viscosity", "B") + self._drag, value("stiffness", "K")

    def _follow_drag(self) -> None:
        """Solve the slope of friction at the present velocity with the viscosity from now on."""
        assert self._dynamics is not None
        position, velocity, last = self._dynamics.state

        def at(speed: float) -> float:
            return sum(entry.term.drag(entry.values, speed) for entry in self._entries)

        steepest = at(0.0)
        if not steepest > 0.0:
            return
        drag = steepest * round(DRAG_STEPS * max(at(velocity), 0.0) / steepest) / DRAG_STEPS
        change = (self._drag - drag) * velocity
        self._drag, self._other = drag, self._other + change
        self._dynamics.resume(
            position, velocity, last - change / (self._stiffness + self._linear()[2])
        )

    def _settle(self, command: float) -> None:
        """Let the plate rest where servo and load are in balance."""
        before = self._run.snapshot()
        still, x, other = np.zeros(1), command, 0.0
        _, _, stiffness = self._linear()
        for _ in range(SETTLING_ROUNDS):
            self._run.restore(before)
            signals = Signals(self._rate, np.array([x]), still, still)
            self._run.torque(signals)
            other = float(sum(part[0] for part in self._run.parts.values())) - stiffness * x
            x = (self._stiffness * command - other) / (self._stiffness + stiffness)
        self._run.restore(before)
        self._other = other
        self._dynamics = SecondOrder(self._rate)
        # The input of the joint system of servo and linear load that holds it there.
        gain = self._stiffness / (self._stiffness + stiffness)
        self._dynamics.resume(x, 0.0, gain * (command - other / self._stiffness))


def _sliced(values: dict[str, Any], part: slice) -> dict[str, Any]:
    return {symbol: value[part] if np.ndim(value) else value for symbol, value in values.items()}
