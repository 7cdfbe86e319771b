"""The pages and their WebSocket.

| path | what |
| --- | --- |
| `/` | the subject's screen |
| `/operator` | the operator's page |
| `/ws?role=subject`, `/ws?role=operator` | JSON text messages |
| `/pages/...` | style and modules |

To every page: ``frame`` at the frame rate and ``state`` at each change, with its version; to
operators ``traces`` ten times a second and an ``answer`` to each command. From every page: the word
``seen`` for each frame. From operators: commands (`operator_commands`).

Each page has its own task that sends the newest frame and state when the page can take them: at
most `IN_FLIGHT` frames are on their way, so a browser that is busy shows fewer frames, not old ones
(a socket's buffer would hold many seconds of them). A page that says ``seen`` to nothing for `SLOW`
seconds is closed. So no page can delay another or the session.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import math
import time
from collections.abc import Callable
from importlib import resources
from typing import Any

from aiohttp import WSCloseCode, WSMsgType, web

from biofeedback.errors import CommandError, MalformedMessageError
from biofeedback.live_signals import LiveSignals
from biofeedback.web.access import COOKIE, Access
from biofeedback.web.connection_limit import ConnectionLimit
from biofeedback.web.operator_commands import LONGEST_MESSAGE, RateLimit, RefusedCommandError, parse
from biofeedback.web.presenter import Desk

FRAME_RATE = 30.0
"""[Hz] The paper's screen had 20 to 30 (section III-B.1)."""
TRACES_EVERY, STATE_EVERY = 3, 3
"""Frames: traces and changes that nobody commanded (health, recording) ten times a second."""
IN_FLIGHT = 3
"""Frames: 100 ms at 30 Hz, more than a page on this computer takes for its answer unless it is
busy.
"""
SEEN = "seen"
"""What a page says to a frame."""
SLOW = 10.0
"""[s] in which a page must take a message and say so."""
LONGEST_COMMAND = 3.0
"""[s] for which a page's next command waits; then the present one is answered as late."""
PAGES = 20
"""Pages that may be open at once: a laboratory has two operators and one subject."""
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; connect-src 'self'; img-src 'self' data:; "
    "frame-ancestors 'none'; base-uri 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}
_KINDS = {"html": "text/html", "css": "text/css", "js": "text/javascript", "svg": "image/svg+xml"}
_logger = logging.getLogger(__name__)


class Page:
    """One open page."""

    def __init__(self, socket: web.WebSocketResponse, role: str) -> None:
        self.socket = socket
        self.role = role
        self.wake = asyncio.Event()
        self.version = -1
        self.in_flight = 0
        self.frame = self.traced = 0
        self.heard = time.monotonic()
        self.traces: dict[str, int] = {}
        self.answers: list[str] = []


class Server:
    """Serves a desk.

    Parameters
    ----------
    desk
        Gives frames and states, takes commands.
    signals
        Gives traces.
    access
        Decides who may come in.
    now
        ROS time [s].
    frame_rate
        [Hz].
    beat
        Called after every frame, for what the owner does regularly.
    """

    def __init__(
        self,
        desk: Desk,
        signals: LiveSignals,
        access: Access,
        now: Callable[[], float],
        frame_rate: float = FRAME_RATE,
        beat: Callable[[], None] = lambda: None,
    ) -> None:
        self._desk = desk
        self._signals = signals
        self._access = access
        self._now = now
        self._period = 1.0 / frame_rate
        self._beat = beat
        self._pages: set[Page] = set()
        self._frame = ""
        self._number = 0
        self._state: dict[str, Any] = {}
        self._state_text = ""
        self._version = 0
        self._files = {
            entry.name: entry.read_bytes()
            for entry in (resources.files("biofeedback") / "pages").iterdir()
            if "." in entry.name
        }
        self.closed_for_cause = 0
        """Pages closed because of what they sent."""
        self.late_frames = 0
        """Frames that were made more than half a period late."""

    async def run(
        self, host: str, port: int, ready: Callable[[int], None], stopped: asyncio.Event
    ) -> None:
        """Serve until told to stop.

        Parameters
        ----------
        port
            0 takes any free one.
        ready
            Called with the port.

        Raises
        ------
        OSError
            The address cannot be had.
        """
        application = web.Application(client_max_size=LONGEST_MESSAGE)
        for path in ("/", "/operator", "/pages/{name}"):
            application.router.add_get(path, self._serve)
        application.router.add_get("/ws", self._talk)
        runner = web.AppRunner(application, access_log=None)
        await runner.setup()
        assert runner.server is not None
        self._limit = ConnectionLimit(runner.server)
        listener = await asyncio.get_running_loop().create_server(self._limit, host, port)
        try:
            ready(listener.sockets[0].getsockname()[1])
            await self._make_frames(stopped)
        finally:
            listener.close()
            for page in list(self._pages):
                with contextlib.suppress(Exception):
                    await asyncio.wait_for(
                        page.socket.close(code=WSCloseCode.GOING_AWAY, message=b"the node stops"),
                        1.0,
                    )
            await runner.cleanup()

    async def _make_frames(self, stopped: asyncio.Event) -> None:
        """By absolute deadlines, so that the rate holds whatever a frame costs."""
        due = time.monotonic()
        while not stopped.is_set():
            late = time.monotonic() - due
            if late > 0.5 * self._period:
                self.late_frames += 1
                due += max(math.floor(late / self._period), 0) * self._period
            self._frame = _text(self._desk.frame(self._now(), time.monotonic()))
            self._number += 1
            if self._number % STATE_EVERY == 0:
                self._look_for_change()
            for page in self._pages:
                page.wake.set()
            self._beat()
            due += self._period
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(stopped.wait(), max(due - time.monotonic(), 0.0))

    def _look_for_change(self) -> None:
        state = self._desk.state(time.monotonic())
        state["pages"] = {
            role: sum(page.role == role for page in self._pages) for role in ("subject", "operator")
        }
        if state != self._state:
            self._state, self._version = state, self._version + 1
            self._state_text = _text({"type": "state", "version": self._version, **state})

    def _refusal(self, request: web.Request) -> str | None:
        token = request.query.get("token") or request.cookies.get(COOKIE, "")
        return self._access.refusal(
            request.headers.get("Host", ""), request.headers.get("Origin"), token
        )

    async def _serve(self, request: web.Request) -> web.Response:
        name = {"/": "subject.html", "/operator": "operator.html"}.get(
            request.path
        ) or request.match_info["name"]
        refusal = self._refusal(request)
        if refusal is not None:
            return web.Response(status=403, text=f"Refused: {refusal}.\n", headers=HEADERS)
        if name not in self._files:
            return web.Response(status=404, text="There is no such page.\n", headers=HEADERS)
        kind = _KINDS.get(name.rpartition(".")[2], "application/octet-stream")
        answer = web.Response(
            body=self._files[name], content_type=kind, charset="utf-8", headers=HEADERS
        )
        if self._access.token and "token" in request.query:
            answer.set_cookie(COOKIE, self._access.token, httponly=True, samesite="Strict")
        return answer

    async def _talk(self, request: web.Request) -> web.StreamResponse:
        role = request.query.get("role", "")
        refusal = self._refusal(request)
        if refusal is None and role not in ("subject", "operator"):
            refusal = "role must be subject or operator"
        if refusal is None and len(self._pages) >= PAGES:
            refusal = f"{PAGES} pages are open already"
        if refusal is not None:
            return web.Response(status=403, text=f"Refused: {refusal}.\n", headers=HEADERS)
        socket = web.WebSocketResponse(
            max_msg_size=LONGEST_MESSAGE, heartbeat=10.0, timeout=2.0, compress=False
        )
        await socket.prepare(request)
        page = Page(socket, role)
        self._limit.hold(request.transport)
        self._pages.add(page)
        sending = asyncio.create_task(self._send(page))
        try:
            await self._listen(page)
        finally:
            self._pages.discard(page)
            sending.cancel()
            with contextlib.suppress(asyncio.CancelledError, Exception):
                await sending
        return socket

    async def _send(self, page: Page) -> None:
        """The newest of everything, whenever the page can take it."""
        try:
            while True:
                await page.wake.wait()
                page.wake.clear()
                messages, page.answers = page.answers, []
                if page.in_flight < IN_FLIGHT:
                    messages += self._news(page)
                elif time.monotonic() - page.heard > SLOW:
                    raise asyncio.TimeoutError
                for message in messages:
                    await asyncio.wait_for(page.socket.send_str(message), SLOW)
        except (ConnectionError, asyncio.TimeoutError):
            await self._close(
                page, WSCloseCode.TRY_AGAIN_LATER, "the page does not take its messages"
            )

    def _news(self, page: Page) -> list[str]:
        """What a page has not been sent: state, frame, traces."""
        news = []
        if page.version != self._version and self._state_text:
            page.version = self._version
            news.append(self._state_text)
        if page.frame == self._number:
            return news
        news.append(self._frame)
        page.in_flight += 1
        page.frame = self._number
        if page.role == "operator" and page.frame - page.traced >= TRACES_EVERY:
            page.traced = page.frame
            bins = self._signals.traces_since(page.traces)
            for name, found in bins.items():
                page.traces[name] = found["first"] + len(next(iter(found["low"].values()), [])) - 1
            if bins:
                news.append(_text({"type": "traces", "groups": bins, "widths": self._widths}))
        return news

    @property
    def _widths(self) -> dict[str, float]:
        return {name: group.width for name, group in self._signals.traces.items()}

    async def _listen(self, page: Page) -> None:
        limit = RateLimit(time.monotonic())
        async for message in page.socket:
            if message.type == WSMsgType.ERROR:
                return
            if message.type == WSMsgType.TEXT and message.data == SEEN and page.in_flight > 0:
                page.in_flight -= 1
                page.heard = time.monotonic()
                page.wake.set()
                continue
            if not limit.allows(time.monotonic()):
                return await self._close(page, WSCloseCode.POLICY_VIOLATION, "too many messages")
            if message.type != WSMsgType.TEXT or page.role != "operator":
                return await self._close(
                    page, WSCloseCode.POLICY_VIOLATION, "this page has nothing to say"
                )
            try:
                answer = await self._carry_out(message.data)
            except MalformedMessageError as error:
                return await self._close(page, WSCloseCode.POLICY_VIOLATION, str(error))
            page.answers.append(_text(answer))
            self._look_for_change()
            for other in self._pages:
                other.wake.set()

    async def _carry_out(self, text: str) -> dict[str, Any]:
        number = -1
        try:
            command = parse(text)
            number = command.number
            await asyncio.wait_for(self._desk.carry_out(command), LONGEST_COMMAND)
        except RefusedCommandError as error:
            return {"type": "answer", "id": error.number, "ok": False, "error": str(error)}
        except CommandError as error:
            return {"type": "answer", "id": number, "ok": False, "error": str(error)}
        except asyncio.TimeoutError:
            return {
                "type": "answer",
                "id": number,
                "ok": False,
                "error": f"no answer from the rig within {LONGEST_COMMAND:g} s",
            }
        return {"type": "answer", "id": number, "ok": True}

    async def _close(self, page: Page, code: WSCloseCode, reason: str) -> None:
        self.closed_for_cause += 1
        self._pages.discard(page)
        _logger.warning("a page (%s) was closed: %s", page.role, reason)
        with contextlib.suppress(Exception):
            await asyncio.wait_for(page.socket.close(code=code, message=reason.encode()[:120]), 1.0)


def _text(content: dict[str, Any]) -> str:
    return json.dumps(content, separators=(",", ":"), allow_nan=False)
