"""What a session and its rig have agreed on, and whether the rig keeps to it."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable

from biofeedback.errors import CommandError
from biofeedback.session.devices import Rig

ANSWER_TIMEOUT = 3.0
"""[s] Longest wait for the rig's answer to arm and start. A driver on a loaded machine answers
within 0.1 s; an operator waits no longer before acting."""
RIG_PATIENCE = 1.5
"""[s] Longest wait for a started rig to run: a rig that has agreed to start reports that it runs
within milliseconds; that its driver has died is seen within a second."""
RESUME_PATIENCE = 4.0
"""[s] Longest wait of a resumed session for its rig: a restarted node finds driver and latched
state within two seconds on a loaded machine."""
WATCH_AFTER_LOST_ANSWER = 10.0
"""[s] Time for which an unanswered start is watched: a start that was not answered may still be
carried out: a request waits in the driver's queue for as long as the driver is held up, and a rig
that hangs longer is stopped by its own watchdog."""
WATCH_PERIOD = 0.5
"""[s] Time between two stops while a start whose answer was lost may still be carried out."""
_IDLE_RIG = ("disabled", "ready", "fault")
"""States of a rig that moves nothing."""


class RigAgreement:
    """Asks the rig, and follows whether it does what it has agreed to.

    Parameters
    ----------
    rig
        What is asked.
    stop
        Stops rig and session, with the reason; called where an answer does not come.
    monotonic
        Present monotonic time [s]; whoever advances the session goes on setting it.
    """

    def __init__(self, rig: Rig, stop: Callable[[str], None], monotonic: float) -> None:
        self._rig, self._stop = rig, stop
        self.monotonic = monotonic
        self._agreed_at: float | None = None
        self._patience = RIG_PATIENCE
        self._watch_until = self._watched_at = -math.inf

    async def ask(self, action: str) -> None:
        """Ask the rig to ``arm`` or ``start``; without a rig there is nothing to agree on.

        Raises
        ------
        CommandError
            The rig refuses, or its answer does not come.
        """
        if not self._rig.present:
            self._agreed_at = None
            return
        before = self._agreed_at, self._patience
        # From the request on: an armed session waits here for its start.
        self._agreed_at, self._patience = self.monotonic, math.inf
        try:
            await self.answer(action)
        except BaseException:
            self._agreed_at, self._patience = before
            raise
        self._agreed_at, self._patience = self.monotonic, RIG_PATIENCE

    async def answer(self, action: str) -> None:
        """Await the rig's answer; where it does not come, the rig is stopped and watched.

        Raises
        ------
        CommandError
            The rig refuses, or its answer does not come.
        """
        try:
            await asyncio.wait_for(self._rig.call(action), ANSWER_TIMEOUT)
        except CommandError:
            raise
        except BaseException as error:
            self.watch()
            self._stop(f"the rig did not answer to {action.replace('_', ' ')}")
            if isinstance(error, asyncio.TimeoutError):
                raise CommandError(
                    f"no answer from the rig within {ANSWER_TIMEOUT:g} s; it has been stopped"
                ) from None
            raise

    def resume(self, monotonic: float) -> None:
        """Follow, from `monotonic` [s] on, the rig of a session that ran before."""
        self._agreed_at, self._patience = monotonic, RESUME_PATIENCE

    def broken(self, state: str) -> str:
        """Return why an active session in `state` must stop for its rig; empty where it need not:
        the rig had a fault, was commanded by another, or its driver is gone.
        """
        if self._agreed_at is None:
            appeared = "a rig driver has appeared; arm again, together with the rig"
            return appeared if self._rig.present else ""
        if self.monotonic - self._agreed_at < self._patience:
            return ""
        if not self._rig.present:
            return "the rig's driver is gone"
        reported = self._rig.describe()["state"]
        keeps = reported.split(":")[0] in ("", state)
        return "" if keeps else f"the rig is not {state}: {reported}"

    def watch(self) -> None:
        """Watch the rig from now on: what it was asked may still be carried out."""
        self._watch_until = self.monotonic + WATCH_AFTER_LOST_ANSWER

    def stop_late_start(self) -> None:
        """Repeat the stop while a start that was not answered may still be carried out; called
        while no session is active.
        """
        if self.monotonic > self._watch_until:
            return
        idle = self._rig.describe()["state"].split(":")[0] in _IDLE_RIG
        if not idle and self.monotonic - self._watched_at >= WATCH_PERIOD:
            self._watched_at = self.monotonic
            self._rig.stop()
