"""Parameters of the driver that are no limits."""

from __future__ import annotations

from ankle_actuator_driver.safety.limits import HARD_LIMIT_PARAMETERS, LIMIT_PARAMETERS
from ankle_node.parameters import Parameter

DEVICE_PORT = 20480
"""UDP port of the rig; its control port in the emulator is the next one."""

RIG_ADDRESS = Parameter(
    "rig_address", "127.0.0.1", "", "Address of the rig's controller.", fixed=True
)
RIG_PORT = Parameter(
    "rig_port", DEVICE_PORT, "1", "UDP port of the rig's controller.", 1, 65535, fixed=True
)
LOCAL_ADDRESS = Parameter(
    "local_address",
    "",
    "",
    "Address of this computer to receive at; empty: the one that reaches the rig.",
    fixed=True,
)
LOCAL_PORT = Parameter(
    "local_port", 0, "1", "UDP port of this computer; 0: a free one.", 0, 65535, fixed=True
)
REFERENCE_DELAY = Parameter(
    "reference_delay",
    0.0,
    "s",
    "How much later than its own time the reference is followed, for a source that does not send "
    "it ahead of its time "
    "(perturbation_generator.lead does).",
    0.0,
    1.0,
    fixed=True,
)
SOFT_START = Parameter(
    "soft_start",
    1.0,
    "s",
    "Time over which the plate goes from where it is held to the reference.",
    0.2,
    30.0,
)
AUTOSTART = Parameter(
    "autostart",
    False,
    "",
    "Whether the node configures and activates itself; it is never armed by itself.",
    fixed=True,
)
READERS = Parameter(
    "wait_for_readers",
    0,
    "1",
    "Readers of /ankle/samples to wait for before the first block is sent.",
    0,
    100,
    fixed=True,
)

PARAMETERS: tuple[Parameter, ...] = (
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
