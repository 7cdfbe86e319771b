"""A calibrated subject with six terms beside the core, for the benchmarks of the estimators."""

from __future__ import annotations

from ankle_physics.model import PAPER_TERMS, Model
from impedance_estimator.known_physics import KnownPhysics

ADDITIONAL_TERMS = (
    "maxwell_relaxation",
    "coulomb_friction",
    "short_range_stiffness",
    "hardening_stiffness",
    "asymmetric_damping",
    "long_latency_reflex",
)
"""A calibrated subject has these terms beside inertia, viscosity, stiffness and reflex."""


def subject() -> KnownPhysics:
    """A calibrated subject with `ADDITIONAL_TERMS`, whose reflex is followed in size alone."""
    model = Model.of({name: {} for name in (*PAPER_TERMS, *ADDITIONAL_TERMS)})
    model.entry("reflex").standard_errors = {"G": 0.5}
    return KnownPhysics(subject=model)
