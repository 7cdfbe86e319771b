"""What a fault of the campaign in virtual time is, and what can happen to a laboratory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from campaign_laboratory import Campaign
from virtual_laboratory import RATE

from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings
from rig_emulator.faults import Faults

Act = Callable[[Campaign], object]
LEAD = 0.5  # s; a plate follows what was sent for so long
OPERATOR = 2.0  # s; operator_timeout
COMMANDS = 1.0  # s; a driver that takes no commands


def nothing(lab: Campaign) -> None:
    """Leave everything as it is."""


@dataclass(frozen=True)
class Fault:
    """A fault and what is promised for it.

    Attributes
    ----------
    name
        For the table.
    promise
        One of the promises of `fault_table.KEPT_STATES`, or ``any``.
    begin, end
        What happens to the laboratory.
    moment
        In which it begins, as `at_moment` names it.
    lasts
        Time from beginning to end [s].
    notice
        Time for which the fault may go unnoticed, because it is none before [s].
    new_stream
        Whether another stream of samples begins with it: what lies between the two streams is no
        gap in one of them, and the driver reports it as an interruption.
    """

    name: str
    promise: str
    begin: Act
    end: Act = lambda lab: lab.faults()
    moment: str = "running"
    lasts: float = 0.6
    notice: float = 0.0
    new_stream: bool = False


def switch(**switches: float) -> Act:
    """Return what switches on faults of line, sensors and controller."""
    return lambda lab: lab.faults(**switches)


def line(up: float = 1.0, down: float = 1.0, **switches: float) -> Act:
    """Return what switches on faults of the line, weighted for each way."""

    def begin(lab: Campaign) -> None:
        lab.up.faults = Faults(**{name: up * value for name, value in switches.items()})
        lab.down.faults = Faults(**{name: down * value for name, value in switches.items()})

    return begin


def sets(name: str, value: object, after: object) -> dict[str, Act]:
    """Return what sets an attribute of the laboratory, and what sets it back."""
    return {
        "begin": lambda lab: setattr(lab, name, value),
        "end": lambda lab: setattr(lab, name, after),
    }


def blocks(kind: str) -> dict[str, Act]:
    """Return what tampers with blocks of the reference on their way to the driver."""
    return sets("tampering", kind, "")


def late_blocks(seconds: float) -> dict[str, Act]:
    """Return what lets blocks of the reference come late."""

    def begin(lab: Campaign) -> None:
        lab.tampering, lab.delay_of_blocks = "delayed", seconds

    return {"begin": begin, "end": lambda lab: setattr(lab, "tampering", "")}


def commands(*names: str, apart: float = 0.0) -> Act:
    """Return what gives commands, so many seconds apart."""

    def begin(lab: Campaign) -> None:
        for name in names:
            lab.command(name)
            lab.run(apart)

    return begin


def new_driver(lab: Campaign) -> None:
    """Kill the driver and start it again."""
    lab.bridge_number += 1
    lab.new_driver(lab.bridge_number)


def new_rig(lab: Campaign) -> None:
    """Restart the rig's controller."""
    old = lab.device
    lab.device = type(old)(lab.plant, lab.limits, RATE, old._session + 1, lab.rig_time)
    lab.device.command = (old.command[0], 0.0, 0.0)
    lab.device.commands, lab.device.velocities = old.commands, old.velocities


def new_generator(lab: Campaign) -> None:
    """Let the perturbation begin from its start."""
    lab.signal = PulseStep(Settings(rate=RATE, seed=4))


def ros_time(seconds: float) -> Act:
    """Return what sets ROS time."""

    def begin(lab: Campaign) -> None:
        lab.epoch += seconds
        lab.reference_shift += seconds

    return begin


def rig_clock(seconds: float) -> Act:
    """Return what sets the rig's clock."""

    def begin(lab: Campaign) -> None:
        lab.offset += seconds
        lab.device._begin += seconds

    return begin


def generator_clock(seconds: float) -> Act:
    """Return what sets the clock of the generator's computer alone."""

    def begin(lab: Campaign) -> None:
        lab.reference_shift += seconds

    return begin


def emergency_stop(pressed: bool) -> Act:
    """Return what presses or releases the button at the rig."""
    return lambda lab: lab.device.press_emergency_stop(pressed, lab.rig_time)


def together(*acts: Act) -> Act:
    """Return what does several things at once."""

    def begin(lab: Campaign) -> None:
        for act in acts:
            act(lab)

    return begin


def stranger(begin: Act) -> dict[str, Act]:
    """Return what lets a stranger speak on the line, and what ends it."""
    return {"begin": begin, "end": lambda lab: lab.strangers.clear()}


def vanishing(name: str) -> dict[str, Act]:
    """Return what lets the operator or the commanding thread be there, and vanish."""

    def begin(lab: Campaign) -> None:
        setattr(lab, name, True)
        lab.run(0.2)
        setattr(lab, name, False)

    return {"begin": begin, "end": lambda lab: setattr(lab, name, True)}
