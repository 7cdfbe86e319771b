"""Parameters of the driver that are no limits."""

from __future__ import annotations

from ankle_actuator_driver.link.rig_link import DEVICE_PORT, link_names
from ankle_actuator_driver.safety.bridge import USUAL_OPERATOR_TIMEOUT
from ankle_actuator_driver.safety.limits import HARD_LIMIT_PARAMETERS, LIMIT_PARAMETERS
from ankle_actuator_driver.safety.sensor_supervision import SENSOR_PARAMETERS
from ankle_interfaces.quantity import Quantity

LINK = Quantity(
    "link",
    default="udp",
    choices=link_names(),
    description="Line to the rig: a module of ankle_actuator_driver.link.",
    start_only=True,
)
KEY_FILE = Quantity(
    "key_file",
    default="",
    description=(
        "File with the key (16 to 32 bytes) that driver and rig share; empty: the line is a "
        "dedicated one that nobody else reaches."
    ),
    start_only=True,
)

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
        "Delay after its own time with which the reference is followed, for a source that does "
        "not send it ahead of its time (perturbation_generator.lead does)."
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
OPERATOR_TIMEOUT = Quantity(
    "operator_timeout",
    "s",
    0.3,
    30.0,
    USUAL_OPERATOR_TIMEOUT,
    "twenty messages of the operator's page, longer than a page needs to reload",
    "Time for which an operator's page that was heard in this arming may stay away before the "
    "plate is stopped.",
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
    LINK,
    RIG_ADDRESS,
    RIG_PORT,
    KEY_FILE,
    LOCAL_ADDRESS,
    LOCAL_PORT,
    REFERENCE_DELAY,
    SOFT_START,
    OPERATOR_TIMEOUT,
    AUTOSTART,
    READERS,
    *LIMIT_PARAMETERS,
    *HARD_LIMIT_PARAMETERS,
    *SENSOR_PARAMETERS,
)
