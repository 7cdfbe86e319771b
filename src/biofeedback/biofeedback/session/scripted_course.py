"""An operator and a learning simulated subject in one program, over the pages' own WebSocket.

It leads one session of a conditioning course from the check list to its last trial. The subject
holds the torque that is asked for; its reflex scatters from trial to trial, and after a success its
mean moves a part of the way towards what was rewarded (`simulated_learner`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import aiohttp
import numpy as np

from biofeedback.errors import SessionError
from biofeedback.live_signals import GOOD
from biofeedback.session.scripted_session import LIMITS, ScriptedSession

LARGEST_PUSH = 20.0
"""[N.m] Largest push of the simulated subject, its maximal voluntary contraction."""
SETTLING = 4.0
"""[s] Time that the simulated subject needs for a new push: two of its time constants."""


class ScriptedCourse(ScriptedSession):
    """Leads one session of a course by a program.

    Parameters
    ----------
    url
        Of the pages, as ``http://127.0.0.1:8765``.
    tell
        Called with a sentence for each check and each trial.
    excitability
        Of the reflex before the course.
    spread
        Standard deviation of its logarithm from trial to trial.
    gain
        Part of a rewarded deviation by which the mean moves; 0 does not learn.
    seed
        Seed of the random deviations.

    Attributes
    ----------
    learnt
        Change of the logarithm of the excitability so far.
    """

    def __init__(
        self,
        url: str,
        tell: Callable[[str], None],
        excitability: float = 0.5,
        spread: float = 0.3,
        gain: float = 0.2,
        seed: int = 0,
    ) -> None:
        super().__init__(url, _no_moment, tell)
        self._excitability, self._spread, self._gain = excitability, spread, gain
        self._random = np.random.default_rng(seed)
        self._deviation = 0.0
        self._ready_at: float | None = None
        self._done = -1
        self._torque = 0.0
        self.learnt = 0.0

    async def _run(self) -> dict[str, Any]:
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(f"{self._url}/ws?role=operator", max_msg_size=0) as page,
        ):
            asked = ""
            async for state, content in self._frames(page):
                if state["subject"] is None:
                    continue
                if state["session"]["state"] == "finished":
                    return state
                if open_checks := [
                    check for check in state["checks"] if check["state"] not in ("done", "skipped")
                ]:
                    # A rig or an amplifier that is still starting sends nothing to measure.
                    measured = content["torque_quality"] == content["quality"] == GOOD
                    if measured or self._ready_at is None:
                        await self._check(page, open_checks[0], content["now"])
                    continue
                asked = await self._lead(page, state, content, asked)
        raise SessionError("the node closed the connection")

    async def _check(self, page: Any, check: dict[str, Any], now: float) -> None:
        """Do an entry of the check list: push for a contraction, rest for the others."""
        if check["state"] == "running":
            return
        if check["state"] == "failed":
            raise SessionError(f"check '{check['title']}': {check['result']['problem']}")
        push = {"mvc_plantarflexion": LARGEST_PUSH, "mvc_dorsiflexion": -LARGEST_PUSH}.get(
            check["name"], 0.0
        )
        if self._ready_at is None:
            self._ready_at = now + SETTLING
            self._tell(check["title"])
            await self._say(page, "subject", push=push, cocontraction=0.0)
        elif now >= self._ready_at:
            self._ready_at = None
            # The simulated plate is not moved by hand.
            act = "skip" if check["name"] == "range_of_motion" else "begin"
            await self._say(page, "check", check=check["name"], act=act)
            check["state"] = "running"

    async def _lead(
        self, page: Any, state: dict[str, Any], frame: dict[str, Any], asked: str
    ) -> str:
        """Arm and start where the session waits for it; else learn from the last trial."""
        session, trials = state["session"], state["trials"]
        if session["state"] in ("idle", "paused", "armed"):
            wanted = "start" if session["state"] == "armed" else "arm"
            if wanted != asked and (session["kind"] != "break" or frame["remaining"] == 0.0):
                await self._say(page, wanted)
                return wanted
            return asked
        if trials["done"] != self._done:
            self._done = trials["done"]
            self._torque = state["target"]["torque"]
            if trials["last_success"]:
                self.learnt += self._gain * self._deviation
            self._tell(f"trial {self._done} of {trials['planned']}: {trials['last_success']}")
            self._deviation = float(self._random.normal(0.0, self._spread))
            lower, upper = LIMITS["excitability"]
            wanted_size = self._excitability * math.exp(self.learnt + self._deviation)
            await self._say(
                page,
                "subject",
                push=-self._torque,
                excitability=round(min(max(wanted_size, lower), upper), 4),
            )
        return ""


async def _no_moment(kind: str, hold: int) -> None:
    """Show nothing: a course has no moments at which something is looked at."""
