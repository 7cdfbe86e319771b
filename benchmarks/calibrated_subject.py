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
LOAD_PATH = ("lost_motion", "footplate_inertia", "fixation_compliance")
"""Drive, plate and straps, as in the public human trials."""


def subject(*others: str) -> KnownPhysics:
    """A calibrated subject with `ADDITIONAL_TERMS` and others, whose reflex is followed in size
    alone.
    """
    model = Model.of({name: {} for name in (*PAPER_TERMS, *ADDITIONAL_TERMS, *others)})
    model.entry("reflex").standard_errors = {"G": 0.5}
    return KnownPhysics(subject=model)
