"""A line to a rig: orders out, reports in. The driver never asks which one it has.

Adding one is adding one module to this folder: a class `Link` that is a `RigLink`. The parameter
`link` takes the module's name (docs/rig_protocol.md, "Another line"). Another package offers one as
an entry point of the group `ankle_actuator_driver.links`.
"""

from __future__ import annotations

import importlib
import pkgutil
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points

from ankle_actuator_driver.safety.rig import Event, Order
from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Value

PACKAGE = __name__.rpartition(".")[0]
ENTRY_POINT_GROUP = "ankle_actuator_driver.links"
"""Group of entry points by which another package offers a line."""
_NO_LINKS = ("rig_link", "protocol")
DEVICE_PORT = 20480
"""UDP port of the rig; the emulator takes its fault switches at the next one."""


@dataclass(frozen=True)
class Arrival:
    """Holds something that the link gives.

    Attributes
    ----------
    event
        A report of the rig, an interruption, or a remark.
    now
        Steady clock at its arrival [s].
    ros
        ROS time at its arrival [s].
    """

    event: Event
    now: float
    ros: float


@dataclass(frozen=True)
class Clocks:
    """Reads the steady clock and ROS time together.

    Attributes
    ----------
    read
        The steady clock and ROS time at the same moment [s].
    """

    read: Callable[[], tuple[float, float]]


class RigLink(ABC):
    """Connects a driver to one rig. Made by `open_link`; used by one thread, but for `send` and
    `silence`.
    """

    def __init__(self, values: Mapping[str, Value], clocks: Clocks) -> None:
        """Open the line.

        Parameters
        ----------
        values
            The driver's parameters by name.
        clocks
            Steady clock and ROS time.

        Raises
        ------
        OSError
            The line cannot be opened; the message names it.
        QuantityError
            A parameter that this line cannot use.
        """

    @abstractmethod
    def send(self, order: Order) -> None:
        """Send an order to the rig; a line that is down loses it."""

    @abstractmethod
    def receive(self, timeout: float) -> list[Arrival]:
        """Return what has come, in order, waiting up to so many seconds for the first.

        The list is empty where nothing came.
        """

    @abstractmethod
    def silence(self) -> None:
        """Send nothing from now on until `speak`: the rig's own watchdog is to stop it."""

    def speak(self) -> None:
        """Send again after a silence: an operator has reset the fault that it led to."""

    @abstractmethod
    def close(self) -> None:
        """Close the line."""

    def ros_time_was_set(self) -> None:
        """Begin the mapping of the rig's clock again, because ROS time has jumped."""

    def alarm(self) -> str | None:
        """Return what is wrong with this end of the line, as a sentence; None where all is well."""
        return None

    def describe(self) -> str:
        """Return both ends of the line in words, for the log."""
        return type(self).__module__.rpartition(".")[2]

    def figures(self) -> dict[str, str]:
        """Return what to show on ``/diagnostics``, by name with unit."""
        return {}


def link_names() -> tuple[str, ...]:
    """Return the names of all lines: modules of this folder, and what installed packages offer."""
    package = importlib.import_module(PACKAGE)
    found = {module.name for module in pkgutil.iter_modules(package.__path__)}
    return tuple(sorted(found.difference(_NO_LINKS) | _offered().keys()))


def _offered() -> dict[str, EntryPoint]:
    """Return lines of other packages by name."""
    return {entry.name: entry for entry in entry_points(group=ENTRY_POINT_GROUP)}


def open_link(name: str, values: Mapping[str, Value], clocks: Clocks) -> RigLink:
    """Open a line by the name of its module.

    Parameters
    ----------
    name
        As `link_names` gives them.
    values
        The driver's parameters by name.
    clocks
        Steady clock and ROS time.

    Raises
    ------
    QuantityError
        No such line; names those that there are.
    OSError
        The line cannot be opened.
    """
    return link_class(name)(values, clocks)


def link_class(name: str) -> type[RigLink]:
    """Return the class of a line by the name of its module.

    Parameters
    ----------
    name
        As `link_names` gives them.

    Raises
    ------
    QuantityError
        No such line; names those that there are.
    """
    if name not in link_names():
        raise QuantityError(
            f"parameter 'link' = '{name}' is refused; allowed: {', '.join(link_names())}"
        )
    offered = _offered().get(name)
    kind = offered.load() if offered else importlib.import_module(f"{PACKAGE}.{name}").Link
    found: type[RigLink] = kind
    return found
