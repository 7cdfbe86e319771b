"""Every parameter of the node, gathered from the modules that give them their meaning."""

from __future__ import annotations

from ankle_interfaces.quantity import Quantity
from perturbation_generator.edges import SHAPE_PARAMETERS
from perturbation_generator.limits import LIMIT_PARAMETERS
from perturbation_generator.settings import COMMON_PARAMETERS
from perturbation_generator.signals import SIGNAL, SIGNALS

# 32 samples at 2048 Hz are 64 blocks a second.
BLOCK_SIZE = Quantity(
    "block_size", "1", 1, 4096, 32, description="Samples in a block.", start_only=True
)
LEAD = Quantity(
    "lead",
    "s",
    0.0,
    1.0,
    0.0,
    description="Time from the publication of a block to its last sample.",
    start_only=True,
)
READERS = Quantity(
    "wait_for_readers",
    "1",
    0,
    100,
    0,
    description="Readers of the reference to wait for before the signal starts.",
    start_only=True,
)

PARAMETERS: tuple[Quantity, ...] = (
    SIGNAL,
    *COMMON_PARAMETERS,
    *SHAPE_PARAMETERS,
    *(parameter for signal in SIGNALS.values() for parameter in signal.parameters),
    *LIMIT_PARAMETERS,
    BLOCK_SIZE,
    LEAD,
    READERS,
)
