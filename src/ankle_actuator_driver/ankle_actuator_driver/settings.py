"""Parameters of the driver that are no limits."""

from __future__ import annotations

from ankle_actuator_driver.safety.limits import HARD_LIMIT_PARAMETERS, LIMIT_PARAMETERS
from ankle_interfaces.quantity import Quantity

DEVICE_PORT = 20480
"""UDP port of the rig; its control port in the emulator is the next one."""

RIG_ADDRESS = Quantity(
    "rig_address",
    default="127.0.0.1",
    description="Address of the rig's controller.",
    start_only=True,
)
RIG_PORT = Quantity(
    "rig_port",
    "1",
    1,
    65535,
    DEVICE_PORT,
    description="UDP port of the rig's controller.",
    start_only=True,
)
LOCAL_ADDRESS = Quantity(
    "local_address",
    default="",
    description="Address of this computer to receive at; empty: the one that reaches the rig.",
    start_only=True,
)
LOCAL_PORT = Quantity(
    "local_port",
    "1",
    0,
    65535,
    0,
    description="UDP port of this computer; 0: a free one.",
    start_only=True,
)
REFERENCE_DELAY = Quantity(
    "reference_delay",
    "s",
    0.0,
    1.0,
    0.0,
    description=(
        "How much later than its own time the reference is followed, for a source that does not "
        "send it ahead of its time (perturbation_generator.lead does)."
    ),
    start_only=True,
)
SOFT_START = Quantity(
    "soft_start",
    "s",
    0.2,
    30.0,
    1.0,
    description="Time over which the plate goes from where it is held to the reference.",
)
AUTOSTART = Quantity(
    "autostart",
    default=False,
    description="Whether the node configures and activates itself; it is never armed by itself.",
    start_only=True,
)
READERS = Quantity(
    "wait_for_readers",
    "1",
    0,
    100,
    0,
    description="Readers of /ankle/samples to wait for before the first block is sent.",
    start_only=True,
)

PARAMETERS: tuple[Quantity, ...] = (
    RIG_ADDRESS,
    RIG_PORT,
    LOCAL_ADDRESS,
    LOCAL_PORT,
    REFERENCE_DELAY,
    SOFT_START,
    AUTOSTART,
    READERS,
    *LIMIT_PARAMETERS,
    *HARD_LIMIT_PARAMETERS,
)
