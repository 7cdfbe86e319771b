"""A session with a rig, and changes of it, from the values of the driver's parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from ankle_actuator_driver.link.rig_link import Clocks, open_link
from ankle_actuator_driver.rig_session import News, RigSession, both_clocks
from ankle_actuator_driver.safety.bridge import Bridge
from ankle_actuator_driver.safety.limits import limits_from
from ankle_actuator_driver.safety.sensor_supervision import expectations_from
from ankle_interfaces.quantity import Value


def open_session(
    values: Mapping[str, Value],
    fault: str,
    ros_time: Callable[[], float],
    tell: Callable[[News], None],
    fail: Callable[[Exception], None],
) -> RigSession:
    """Open the line to the rig.

    Parameters
    ----------
    values
        Value of every parameter by name.
    fault
        Of the session before, still to be reset; empty: none.
    ros_time
        Reads ROS time [s].
    tell, fail
        See `RigSession`.

    Raises
    ------
    OSError
        The line cannot be opened.
    """
    clocks = partial(both_clocks, ros_time)
    link = open_link(str(values["link"]), values, Clocks(clocks))
    bridge = Bridge(
        limits_from(values),
        float(values["soft_start"]),
        float(values["reference_delay"]),
        fault,
    )
    adjustment(values)(bridge)
    return RigSession(bridge, link, clocks, tell, fail)


def adjustment(values: Mapping[str, Value]) -> Callable[[Bridge], None]:
    """Return what gives a bridge the properties that may change while it drives a rig.

    The limits are not among them: `RigSession.change` takes these apart, because a plate that is on
    its way beyond a new one is stopped.
    """
    soft_start, timeout = float(values["soft_start"]), float(values["operator_timeout"])
    expectations = expectations_from(values)

    def adjust(bridge: Bridge) -> None:
        bridge.soft_start, bridge.operator_timeout = soft_start, timeout
        bridge.expectations = expectations

    return adjust
