"""What a session acts on, as it sees it: the rig, a simulated subject, the perturbation, the
program that calibrates session or rig, the estimator that goes on with its model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol


class Rig(Protocol):
    """Describes the interface to the rig's drivers, as far as a session commands them."""

    @property
    def present(self) -> bool:
        """Tell whether there is exactly one driver, which may be commanded."""

    @property
    def several(self) -> bool:
        """Tell whether there is more than one driver."""

    @property
    def problem(self) -> str:
        """Return what is wrong with the drivers; empty where nothing is."""

    def describe(self) -> dict[str, Any]:
        """Return the fields of `messages.RigState`."""

    async def call(self, action: str) -> None:
        """Carry out ``arm``, ``start`` or ``reset_fault``; raises `CommandError`."""

    def stop(self) -> None:
        """Stop every driver known now or before, from any thread, without waiting."""

    def announce_operator(self, session_id: str) -> None:
        """Publish the operator's heartbeat."""


class Subject(Protocol):
    """Describes the interface to a simulated subject whose behaviour can be set."""

    def describe(self) -> dict[str, float] | None:
        """Return the present values; None where there is no simulated subject."""

    async def set(self, values: Mapping[str, float]) -> None:
        """Change what the subject does; raises `CommandError`."""


class Perturbation(Protocol):
    """Describes the interface to a generator that gives single stretches.

    Attributes
    ----------
    refusal
        Why the last request was refused; empty where it was not.
    """

    refusal: str

    def give(self) -> None:
        """Ask for one stretch, without waiting."""


@dataclass(frozen=True)
class CalibrationEnd:
    """Holds the end of a calibration.

    Attributes
    ----------
    problem
        Why it failed; empty where it did not.
    figures
        What was found, as the check list shows it.
    """

    problem: str
    figures: Mapping[str, Any]


class Calibration(Protocol):
    """Describes the interface to the program that calibrates session or rig; nothing of it waits.

    Attributes
    ----------
    model
        The file that it writes.
    """

    model: Path

    @property
    def running(self) -> bool:
        """Tell whether the calibration has begun and its end has not been given yet."""

    @property
    def recording(self) -> bool:
        """Tell whether the calibration still needs the moving plate."""

    def begin(self, seconds: float) -> None:
        """Record so many seconds of the moving plate; raises `CommandError`."""

    def progress(self) -> str:
        """Return what the calibration does now."""

    def cancel(self, reason: str) -> None:
        """Ask the calibration to end."""

    def ended(self) -> CalibrationEnd | None:
        """Return how the calibration ended, once; None before."""


class EstimatorModel(Protocol):
    """Describes the interface to the model that the running estimator uses; nothing of it waits."""

    @property
    def confirmed(self) -> bool:
        """Tell whether the estimates are made with the model that was handed over last."""

    @property
    def refusal(self) -> str:
        """Tell why the estimator refused that model; empty where it did not."""

    def prepare(self) -> None:
        """Load, beside the session, what handing a model over needs."""

    def hand_over(self, model: Path | None) -> None:
        """Ask the estimator to go on with a model, or without one; raises `CommandError`."""
