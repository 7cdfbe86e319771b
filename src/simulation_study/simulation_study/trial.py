"""A simulated trial states the rig, the ankle, its changes and the estimators."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

VISCOSITY, INERTIA = 0.63, 0.0137
"""[N.m.s/rad], [kg.m^2]: fixed throughout. van 't Veld et al. 2018, section III-A."""
DURATION = 240.0
"""[s] van 't Veld et al. 2018, section III-A."""


@dataclass(frozen=True)
class Ankle:
    """Holds parameters of the joint; defaults from van 't Veld et al. 2018, section III-A."""

    K: float = 100.0
    """[N.m/rad]"""
    G: float = 10.0
    """[N.m.s/rad]"""
    omega: float = 21.0
    """Natural frequency of the reflex [rad/s]."""
    z: float = 0.8
    """Damping of the reflex [1]."""
    delay: float = 0.040
    """Delay of the reflex [s]."""
    voluntary_rms: float = 0.0
    """Voluntary torque [N.m]."""
    voluntary_cutoff: float = 0.3
    """[Hz]"""


@dataclass(frozen=True)
class Course:
    """Describes how K and G move, both at once and in the same proportion about their range.

    Attributes
    ----------
    kind
        'jump', 'ramp' or 'sinusoid'.
    K
        First and last value, or the extremes of a sinusoid [N.m/rad].
    G
        Likewise [N.m.s/rad].
    at
        Begin [s].
    over
        Length of a ramp [s].
    frequency
        Of a sinusoid [Hz].
    """

    kind: str
    K: tuple[float, float] = (50.0, 150.0)
    G: tuple[float, float] = (5.0, 15.0)
    at: float = 100.0
    over: float = 0.0
    frequency: float = 0.0

    def changes(self) -> list[dict[str, Any]]:
        """Return a scenario of `ankle_physics.scenario`; the first values hold from the start."""
        keys = {"stiffness.K[N.m/rad]": self.K, "reflex.G[N.m.s/rad]": self.G}
        if self.kind == "sinusoid":
            waves = {
                key: {
                    "mean": (low + high) / 2.0,
                    "amplitude": (high - low) / 2.0,
                    "frequency[Hz]": self.frequency,
                }
                for key, (low, high) in keys.items()
            }
            return [{"at[s]": 0.0, **waves}]
        moved: dict[str, Any] = {"at[s]": self.at, **{key: high for key, (_, high) in keys.items()}}
        if self.kind == "ramp":
            moved["over[s]"] = self.over
        return [{"at[s]": 0.0, **{key: low for key, (low, _) in keys.items()}}, moved]


@dataclass(frozen=True)
class Trial:
    """Describes what is simulated, and which estimators read it.

    Attributes
    ----------
    name
        Unique within a study; names the file of its result.
    rig
        Signal and model, a name in `rigs.RIGS`.
    estimators
        Names in `estimates.ESTIMATORS`.
    seed
        Of perturbation and noise.
    seconds
        Length.
    """

    name: str
    rig: str
    estimators: tuple[str, ...]
    seed: int
    ankle: Ankle = field(default_factory=Ankle)
    course: Course | None = None
    seconds: float = DURATION

    def as_content(self) -> dict[str, Any]:
        """Return the trial as content for JSON."""
        return asdict(self)
