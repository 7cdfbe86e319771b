"""Operate the rig: arm, start, stop, disarm, reset-fault, state; faults of its emulator."""

from __future__ import annotations

from typing import Annotated

import typer

from ankle_bringup.terminal import Namespace, console

verb = typer.Typer()


def _operate(command: str, namespace: str) -> None:
    from ankle_bringup.errors import RunError
    from ankle_bringup.live_graph import latched, observer, trigger
    from ankle_bringup.rig_advice import NEVER_REFUSED, STATE_PATIENCE, ends_in_fault, with_advice
    from ankle_interfaces.topics import RIG_STATE

    with observer(namespace=namespace) as node:
        done, sentence = trigger(node, "ankle_actuator_driver", command)
        state = ""
        if not done or command in NEVER_REFUSED:
            state = latched(node, RIG_STATE.name, STATE_PATIENCE) or ""
    if not done or ends_in_fault(command, state):
        raise RunError(with_advice(command, sentence, state, namespace))
    console.print(sentence)


@verb.command()
def arm(namespace: Namespace = "") -> None:
    """Let the drive hold the plate, at zero velocity.

    Example: ankle rig arm
    """
    _operate("arm", namespace)


@verb.command()
def start(namespace: Namespace = "") -> None:
    """Let the plate follow the perturbation; needs an armed rig.

    Example: ankle rig start
    """
    _operate("start", namespace)


@verb.command()
def stop(namespace: Namespace = "") -> None:
    """Bring the plate to rest and switch the drive off, from any state. The button at the rig is
    faster than a command. After a fault it says why, and ends with exit code 1.

    Example: ankle rig stop
    """
    _operate("stop", namespace)


@verb.command()
def disarm(namespace: Namespace = "") -> None:
    """Switch the drive off.

    Example: ankle rig disarm
    """
    _operate("disarm", namespace)


@verb.command("reset-fault")
def reset_fault(namespace: Namespace = "") -> None:
    """Leave a fault whose cause is gone; the rig has to be armed again.

    Example: ankle rig reset-fault
    """
    _operate("reset_fault", namespace)


@verb.command()
def state(
    seconds: Annotated[float, typer.Option(help="How long to wait for an answer.")] = 5.0,
    namespace: Namespace = "",
) -> None:
    """Show the state of the rig and its reason.

    Example: ankle rig state
    """
    from ankle_bringup.errors import RunError
    from ankle_bringup.live_graph import latched, observer
    from ankle_interfaces.topics import RIG_STATE

    with observer(namespace=namespace) as node:
        text = latched(node, RIG_STATE.name, seconds)
    if text is None:
        raise RunError(
            f"nobody said anything on '{RIG_STATE.name}' within {seconds:g} s: no actuator driver "
            "runs, or it is not active"
        )
    console.print(text)


@verb.command()
def faults(
    switches: Annotated[
        str, typer.Argument(help="As 'drop=0.1,freeze=1'; 'none' switches all off.")
    ] = "",
    address: Annotated[str, typer.Option(help="Of the emulator.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="The emulator's parameter 'port'.")] = 0,
) -> None:
    """Switch faults of the rig emulator, or show those that are on.

    Example: ankle rig faults drop=0.1,emergency_stop=1
    """
    from ankle_actuator_driver.settings import DEVICE_PORT
    from rig_emulator.fault_switches import switch_faults

    console.print(switch_faults(switches, address, port or DEVICE_PORT))
