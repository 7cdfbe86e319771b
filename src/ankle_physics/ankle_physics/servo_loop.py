"""A plate behind a servo that gives way: its motion depends on the torque, and the torque on it.

Equation, with the servo's natural frequency w, damping z, stiffness k_a, the command x and the
torque T of plate and joint::

    y'' + 2 z w y' + w^2 y = w^2 (x - T / k_a),    T = I y'' + B y' + K y + other

Inertia, viscosity and stiffness are solved together with the servo, exactly for inputs that are
linear between samples. ``other`` is found by waveform relaxation over short windows, as in
`ankle_physics.compliant_coupling`; it comes late (reflex) or is small, so that few rounds suffice.
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

# Shorter than the shortest reflex delay, so that a window's reflex is known when it begins.
WINDOW = 0.016  # s
# Windows converge in four to eight rounds; one that does not is a model without a solution.
MOST_ROUNDS = 60
# Of the torque, or of 1 N.m where it is smaller; far below any sensor's resolution.
TOLERANCE = 1e-9
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
        length = max(1, round(WINDOW * self._rate))
        try:
            for start in range(0, len(command), length):
                part = slice(start, min(start + length, len(command)))
                for entry, own in zip(self._entries, values, strict=True):
                    entry.values.update(_sliced(own, part))
                if self._dynamics is None:
                    self._settle(float(command[0]))
                signals = self._window(command[part])
                motion[:, part] = signals.position, signals.velocity, signals.acceleration
                torque[part] = signals.torque
                measured[:, part] = signals.measured_position, signals.measured_velocity
                for name, own_torque in self._run.parts.items():
                    parts.setdefault(name, np.empty(len(command)))[part] = own_torque
        finally:
            for entry, own in zip(self._entries, values, strict=True):
                entry.values.update(own)
        whole = Signals(self._rate, motion[0], motion[1], motion[2])
        whole.torque = torque
        whole.measured_position, whole.measured_velocity = measured
        return whole, parts

    def _window(self, command: np.ndarray) -> Signals:
        assert self._dynamics is not None
        inertia, viscosity, stiffness = self._linear()
        share = self._omega**2 / self._stiffness
        mass = 1.0 + share * inertia
        omega = math.sqrt((self._omega**2 + share * stiffness) / mass)
        damping = (2.0 * self._damping * self._omega + share * viscosity) / (2.0 * omega * mass)
        gain = self._stiffness / (self._stiffness + stiffness)
        other = np.full(len(command), self._other)
        before, at_rest = self._run.snapshot(), self._dynamics.state
        for _ in range(MOST_ROUNDS):
            self._run.restore(before)
            self._dynamics.resume(*at_rest)
            x, v, a = self._dynamics.run_with_rates(
                gain * (command - other / self._stiffness), omega, damping
            )
            signals = Signals(self._rate, x, v, a)
            self._run.torque(signals)
            total = sum(self._run.parts.values(), np.zeros(len(x)))
            change, other = other, total - inertia * a - viscosity * v - stiffness * x
            if np.abs(other - change).max() <= TOLERANCE * max(1.0, np.abs(total).max()):
                self._other = float(other[-1])
                return signals
            if not np.isfinite(other).all():
                break
        raise ModelError(
            f"the plate's motion does not converge on a servo of {self._stiffness:g} N.m/rad: a "
            "term is too steep for it"
        )

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
                return plate, b, k
        return plate + value("inertia", "I"), value("viscosity", "B"), value("stiffness", "K")

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
