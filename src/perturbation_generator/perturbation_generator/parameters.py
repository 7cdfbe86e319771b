"""Every parameter of the node, gathered from the modules that give them their meaning."""

from __future__ import annotations

from ankle_node.parameters import Parameter
from perturbation_generator.edges import SHAPE_PARAMETERS
from perturbation_generator.limits import LIMIT_PARAMETERS
from perturbation_generator.settings import COMMON
from perturbation_generator.signals import SIGNAL, SIGNALS

# 32 samples at 2048 Hz are 64 blocks a second.
BLOCK_SIZE = Parameter("block_size", 32, "1", "Samples in a block.", 1, 4096, fixed=True)
LEAD = Parameter(
    "lead",
    0.0,
    "s",
    "How long before the time of its last sample a block is published.",
    0.0,
    1.0,
    fixed=True,
)
READERS = Parameter(
    "wait_for_readers",
    0,
    "1",
    "Readers of the reference to wait for before the signal starts.",
    0,
    100,
    fixed=True,
)

PARAMETERS: tuple[Parameter, ...] = (
    SIGNAL,
    *COMMON,
    *SHAPE_PARAMETERS,
    *(parameter for signal in SIGNALS.values() for parameter in signal.parameters),
    *LIMIT_PARAMETERS,
    BLOCK_SIZE,
    LEAD,
    READERS,
)
