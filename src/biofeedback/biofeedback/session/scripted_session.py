"""An operator and a simulated subject in one program, over the pages' own WebSocket.

It leads a session from arm to its end. The subject looks at cursor and target once a second and
corrects push and reflex by a part of what is missing. Used by `ankle demo`; it sends what a page
could send, and nothing else.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any

import aiohttp

from biofeedback.errors import SessionError
from biofeedback.web.server import FRAME_ANSWER

PUSH_CORRECTION = 0.5
"""Part of the torque's error that is corrected each second: the shown torque answers within one."""
FEEDBACK_CORRECTION = 0.1
"""Part of the error of K or G that is corrected each second: an estimate that remembers up to 20 s
answers late, and who corrects faster swings."""
LONGEST_SILENCE = 30.0
"""[s] Longest wait for a message of the node."""
LIMITS = {"excitability": (0.02, 1.0), "cocontraction": (0.0, 1.0)}


class ScriptedSession:
    """Leads a session by a program instead of an operator.

    Parameters
    ----------
    url
        Of the pages, as ``http://127.0.0.1:8765``.
    at_moment
        Awaited with the kind of each step (``baseline``, ``reach``, ``hold``) a third into it.
    tell
        Called with a sentence at each step.
    """

    def __init__(
        self,
        url: str,
        at_moment: Callable[[str, int], Awaitable[None]],
        tell: Callable[[str], None],
    ) -> None:
        self._url = url
        self._at_moment = at_moment
        self._tell = tell
        self._number = 0
        self._moments: set[tuple[str, int]] = set()
        self.frames = 0
        """Frames received."""

    async def run(self, longest: float) -> dict[str, Any]:
        """Lead the session to its end; return the last state.

        Parameters
        ----------
        longest
            [s].

        Raises
        ------
        asyncio.TimeoutError
            It took longer, or the node fell silent.
        SessionError
            A command was refused.
        """
        return await asyncio.wait_for(self._run(), longest)

    async def _run(self) -> dict[str, Any]:
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(f"{self._url}/ws?role=operator", max_msg_size=0) as page,
        ):
            corrected, said = 0.0, ""
            async for state, content in self._frames(page):
                self.frames += 1
                session_state, kind = state["session"]["state"], state["session"]["kind"]
                if session_state == "finished":
                    return state
                if session_state in ("idle", "paused", "armed"):
                    wanted = "start" if session_state == "armed" else "arm"
                    if (
                        (content["quality"] == "valid" or session_state != "idle")
                        and wanted != said
                        and (kind != "break" or content["remaining"] == 0.0)
                    ):
                        said = wanted
                        await self._say(page, wanted)
                    continue
                said = ""
                await self._moment(state, content)
                if content["now"] - corrected >= 1.0 and kind != "baseline":
                    corrected = content["now"]
                    await self._correct(page, state, content)
        raise SessionError("the node closed the connection")

    async def _frames(self, page: Any) -> AsyncIterator[tuple[dict[str, Any], dict[str, Any]]]:
        """Claim the operator's part; yield each frame after the state that is in force."""
        await self._say(page, "claim")
        state: dict[str, Any] = {}
        async for content in self._messages(page):
            if content["type"] == "answer" and not content["ok"]:
                raise SessionError(f"refused: {content['error']}")
            if content["type"] == "state":
                state = content
            if content["type"] == "frame" and state:
                yield state, content

    async def _messages(self, page: Any) -> AsyncIterator[dict[str, Any]]:
        while True:
            message = await page.receive(LONGEST_SILENCE)
            if message.type != aiohttp.WSMsgType.TEXT:
                return
            content = json.loads(message.data)
            if content["type"] == "frame":
                await page.send_str(FRAME_ANSWER)
            yield content

    async def _say(self, page: Any, name: str, **values: float | str) -> None:
        self._number += 1
        await page.send_json({"id": self._number, "command": name, **values})

    async def _moment(self, state: dict[str, Any], frame: dict[str, Any]) -> None:
        session = state["session"]
        which = (session["kind"], session["hold"])
        if which not in self._moments and frame["elapsed"] > session["duration"] / 3:
            self._moments.add(which)
            self._tell(
                f"block {session['block']}, {session['kind']} {session['hold'] or ''}: "
                f"{session['instruction']}"
            )
            await self._at_moment(*which)

    async def _correct(self, page: Any, state: dict[str, Any], frame: dict[str, Any]) -> None:
        """Push by the torque's error; change the reflex or the co-contraction by the ratio of what
        is wanted to what is shown.
        """
        subject, target = state["subject"], state["target"]
        if subject is None or frame["quality"] != "valid":
            return
        changed = {
            "push": round(
                min(
                    max(subject["push"] + PUSH_CORRECTION * (frame["y"] - target["torque"]), -20.0),
                    20.0,
                ),
                3,
            )
        }
        if target["lower"] is not None and frame["x"] > 0.0:
            name = "excitability" if target["feedback"] == "G" else "cocontraction"
            ratio = 0.5 * (target["lower"] + target["upper"]) / frame["x"]
            lower, upper = LIMITS[name]
            changed[name] = round(
                min(max(max(subject[name], 0.02) * ratio**FEEDBACK_CORRECTION, lower), upper), 4
            )
        await self._say(page, "subject", **changed)
