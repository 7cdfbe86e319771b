"""A line to a rig that does at once what it is told, for a first test of a driver."""

from collections.abc import Mapping

from ankle_actuator_driver.link.rig_link import Arrival, Clocks, RigLink
from ankle_actuator_driver.safety.rig import (
    DeviceFault,
    DeviceState,
    Order,
    RigReport,
    Status,
    Wanted,
)
from ankle_interfaces.quantity import Value

STATES = {
    Wanted.OFF: DeviceState.OFF,
    Wanted.HOLD: DeviceState.HOLD,
    Wanted.FOLLOW: DeviceState.FOLLOW,
}


class Link(RigLink):
    """Answers each order with the state that was wanted."""

    def __init__(self, values: Mapping[str, Value], clocks: Clocks) -> None:
        self._clocks, self._wanted = clocks, Wanted.OFF

    def send(self, order: Order) -> None:
        """Keep what is wanted."""
        self._wanted = order.wanted

    def receive(self, timeout: float) -> list[Arrival]:
        """Return one report, at once."""
        now, ros = self._clocks.read()
        state = STATES[self._wanted]
        report = RigReport(state, DeviceFault.NONE, Status(0), True, True, True, 0.0, received=1)
        return [Arrival(report, now, ros)]

    def silence(self) -> None:
        """Send nothing more: what was wanted is over."""
        self._wanted = Wanted.OFF

    def close(self) -> None:
        """Do nothing: no line is open."""
