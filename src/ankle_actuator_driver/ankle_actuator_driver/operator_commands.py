"""The operator's commands to the driver and their answers, some of which wait for the rig."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator

from ankle_actuator_driver.rig_session import RigSession
from ankle_actuator_driver.safety.states import CONFIRMATION, Answer, State

COMMANDS = ("arm", "start", "stop", "disarm", "reset_fault")
CONFIRMED_STATES = {"arm": State.ARMED, "start": State.RUNNING}
"""Commands that are answered when the rig has confirmed them, and the state that they enter."""


class _NextTurn:
    """Lets the executor do other things before the callback that awaits it goes on."""

    def __await__(self) -> Generator[None, None, None]:
        yield


class OperatorCommands:
    """Carries out commands in the present session.

    Parameters
    ----------
    session
        Gives the session; None where the driver is not configured.
    """

    def __init__(self, session: Callable[[], RigSession | None]) -> None:
        self._session = session

    def carry_out(self, name: str) -> Answer:
        """Carry out a command and answer at once."""
        session = self._session()
        if session is None:
            return Answer(name == "stop", f"{name}: the node is not configured, it drives no rig")
        return session.operate(name)

    async def carry_out_confirmed(self, name: str) -> Answer:
        """Carry out an arming or a start, and answer once the rig has confirmed it.

        A stop is carried out meanwhile.
        """
        carried_out = self.carry_out(name)
        session = self._session()
        if session is None or not carried_out.done:
            return carried_out
        deadline = time.monotonic() + 2 * CONFIRMATION
        while (confirmed := session.confirmed(CONFIRMED_STATES[name])) is None:
            if time.monotonic() > deadline:
                return Answer(
                    False, f"{name}: the rig did not confirm it within {CONFIRMATION:g} s"
                )
            await _NextTurn()
        if not confirmed.done:
            return Answer(False, f"{name} failed: {confirmed.sentence}")
        return carried_out
