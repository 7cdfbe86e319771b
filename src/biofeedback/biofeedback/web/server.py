"""The WebSocket of the pages: frames and states to them, commands and stops from them.

`/ws?role=subject` and `/ws?role=operator` carry JSON text messages; every other path is served by
`http_requests`.

To every page: ``frame`` at the frame rate and ``state`` at each change, with its version; to
operators ``traces`` ten times a second, ``command`` (whether the page is the one that may command)
and an ``answer`` to each command; all by `messages`. From every page: the word ``seen`` for each
frame, and ``stop``. From the operator's page in command: commands (`session.commands`).

A stop is carried out by the task that reads the page's socket, before anything else is looked at:
it waits behind no other command and counts against no limit. Commands are carried out by another
task of the page, one after the other; they are forgotten when anybody stops.

Each page has its own task that sends the newest frame and state when the page can take them: at
most `MAX_UNANSWERED_FRAMES` frames are on their way, so a browser that is busy shows fewer frames,
not old ones (a socket's buffer would hold many seconds of them). A page that acknowledges nothing
for `MESSAGE_TIMEOUT` seconds is closed. So no page can delay another or the session.
"""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import json
import logging
import math
import ssl
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from aiohttp import WSCloseCode, WSMsgType, web

from biofeedback.errors import CommandError, MalformedMessageError
from biofeedback.session.commands import (
    BURST,
    FREE_COMMANDS,
    LONGEST_MESSAGE,
    RateLimit,
    RefusedCommandError,
    parse,
)
from biofeedback.session.runner import SessionRunner
from biofeedback.web import messages
from biofeedback.web.access import OPERATOR, ROLES, Access
from biofeedback.web.connection_limit import ConnectionLimit
from biofeedback.web.http_requests import HttpRequests, refused
from biofeedback.web.presenter import Presenter

FRAME_RATE = 30.0
"""[Hz] Number of frames per second: the paper's screen had 20 to 30 (section III-B.1)."""
TRACES_EVERY, STATE_EVERY = 3, 3
"""Frames: traces and changes that nobody commanded (health, recording) ten times a second."""
MAX_UNANSWERED_FRAMES = 3
"""Largest number of frames without an answer: 100 ms at 30 Hz, more than a page on this computer
takes for its answer unless it is busy."""
FRAME_ANSWER = "seen"
"""Word that a page answers to a frame."""
STOP = "stop"
"""Word that a page sends to stop, besides the command of that name."""
MESSAGE_TIMEOUT = 10.0
"""[s] Time in which a page must take a message and acknowledge it."""
PAGE_CLOSING_TIMEOUT = 1.0
"""[s] Time in which an open page must answer when the server ends: a node that is stopped must not
wait for a browser."""
PAGES = 20
"""Largest number of open pages: a laboratory has two operators and one subject."""
_logger = logging.getLogger(__name__)


class Page:
    """Holds one open page."""

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
        self.commands: deque[str] = deque()
        self.commanded = asyncio.Event()
        self.in_command: bool | None = None  # what the page was sent last


class Server:
    """Serves the screens of a session.

    Parameters
    ----------
    runner
        Gives the session's picture, takes commands and stops.
    presenter
        Makes frames and states.
    access
        Decides who may come in.
    clock
        Gives ROS time [s].
    frame_rate
        Rate of the frames [Hz].
    tls
        Certificate and key; None serves plain HTTP.

    Attributes
    ----------
    closed_for_cause
        Pages closed because of what they sent.
    late_frames
        Frames that were made more than half a period late.
    """

    def __init__(
        self,
        runner: SessionRunner,
        presenter: Presenter,
        access: Access,
        clock: Callable[[], float],
        frame_rate: float = FRAME_RATE,
        tls: ssl.SSLContext | None = None,
    ) -> None:
        self._runner = runner
        self._presenter = presenter
        self._requests = HttpRequests(access, runner.stop, secure=tls is not None)
        self._clock = clock
        self._period = 1.0 / frame_rate
        self._tls = tls
        self._pages: set[Page] = set()
        self._commander: Page | None = None
        self._frame = ""
        self._number = 0
        self._state: messages.State | None = None
        self._state_text = ""
        self._version = 0
        self.closed_for_cause = 0
        self.late_frames = 0

    async def run(
        self, host: str, port: int, ready: Callable[[int], None], stopped: asyncio.Event
    ) -> None:
        """Serve until `stopped` is set.

        Parameters
        ----------
        host
            Address.
        port
            0 takes any free one.
        ready
            Called with the port.
        stopped
            Ends the server.

        Raises
        ------
        OSError
            The address cannot be had.
        """
        application = web.Application(client_max_size=LONGEST_MESSAGE)
        application.add_routes([*self._requests.routes(), web.get("/ws", self._talk)])
        runner = web.AppRunner(application, access_log=None, shutdown_timeout=PAGE_CLOSING_TIMEOUT)
        await runner.setup()
        assert runner.server is not None
        self._limit = ConnectionLimit(runner.server)
        listener = await asyncio.get_running_loop().create_server(
            self._limit, host, port, ssl=self._tls
        )
        try:
            ready(listener.sockets[0].getsockname()[1])
            await self._make_frames(stopped)
        finally:
            listener.close()
            for page in list(self._pages):
                with contextlib.suppress(Exception):
                    await asyncio.wait_for(
                        page.socket.close(code=WSCloseCode.GOING_AWAY, message=b"the node stops"),
                        PAGE_CLOSING_TIMEOUT,
                    )
            await runner.cleanup()

    async def _make_frames(self, stopped: asyncio.Event) -> None:
        """Make frames by absolute deadlines, so that the rate holds whatever a frame costs."""
        due = time.monotonic()
        while not stopped.is_set():
            late = time.monotonic() - due
            if late > 0.5 * self._period:
                self.late_frames += 1
                due += max(math.floor(late / self._period), 0) * self._period
            frame = self._presenter.frame(self._runner.view, self._clock(), time.monotonic())
            self._frame = _text(frame)
            self._number += 1
            if self._number % STATE_EVERY == 0:
                self._look_for_change()
            for page in self._pages:
                page.wake.set()
            due += self._period
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(stopped.wait(), max(due - time.monotonic(), 0.0))

    def _look_for_change(self) -> None:
        counts = {role: sum(page.role == role for page in self._pages) for role in ROLES}
        pages = messages.Pages(**counts, in_command=self._commander is not None)
        state = self._presenter.state(self._runner.view, time.monotonic(), pages, self._version)
        if state != self._state:
            self._version += 1
            self._state = dataclasses.replace(state, version=self._version)
            self._state_text = _text(self._state)

    async def _talk(self, request: web.Request) -> web.StreamResponse:
        role = request.query.get("role", "")
        refusal = self._requests.refusal(request)
        if refusal is None and role not in ROLES:
            refusal = "role must be subject or operator"
        if refusal is None and role not in self._requests.roles(request):
            refusal = f"this browser may not open the {role}'s page; enter the token at /enter"
        if refusal is None and len(self._pages) >= PAGES:
            refusal = f"{PAGES} pages are open already"
        if refusal is not None:
            return refused(refusal)
        socket = web.WebSocketResponse(
            max_msg_size=LONGEST_MESSAGE, heartbeat=10.0, timeout=2.0, compress=False
        )
        await socket.prepare(request)
        page = Page(socket, role)
        self._limit.hold(request.transport)
        self._pages.add(page)
        tasks = [asyncio.create_task(work(page)) for work in (self._send, self._work_through)]
        try:
            await self._listen(page)
        finally:
            self._pages.discard(page)
            if self._commander is page:
                self._commander = None
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
        return socket

    async def _send(self, page: Page) -> None:
        """Send the newest of everything, whenever the page can receive it."""
        try:
            while True:
                await page.wake.wait()
                page.wake.clear()
                messages, page.answers = page.answers, []
                if page.in_flight < MAX_UNANSWERED_FRAMES:
                    messages += self._news(page)
                elif time.monotonic() - page.heard > MESSAGE_TIMEOUT:
                    raise asyncio.TimeoutError
                for message in messages:
                    await asyncio.wait_for(page.socket.send_str(message), MESSAGE_TIMEOUT)
        except (ConnectionError, asyncio.TimeoutError):
            await self._close(
                page, WSCloseCode.TRY_AGAIN_LATER, "the page does not take its messages"
            )

    def _news(self, page: Page) -> list[str]:
        """Give what a page has not been sent: state, command, frame, traces."""
        news = []
        in_command = self._commander is page
        if page.role == OPERATOR and page.in_command is not in_command:
            page.in_command = in_command
            news.append(_text(messages.Command(in_command)))
        if page.version != self._version and self._state_text:
            page.version = self._version
            news.append(self._state_text)
        if page.frame == self._number:
            return news
        news.append(self._frame)
        page.in_flight += 1
        page.frame = self._number
        if page.role == OPERATOR and page.frame - page.traced >= TRACES_EVERY:
            page.traced = page.frame
            traces = self._presenter.traces(page.traces)
            if traces is not None:
                for name, bins in traces.groups.items():
                    count = len(next(iter(bins.low.values()), []))
                    page.traces[name] = bins.first + count - 1
                news.append(_text(traces))
        return news

    async def _listen(self, page: Page) -> None:
        """Read what a page sends: a stop is carried out here, everything else is passed on."""
        limit = RateLimit(time.monotonic())
        async for message in page.socket:
            if message.type == WSMsgType.ERROR:
                return
            if message.type == WSMsgType.TEXT and _is_stop(message.data):
                self._stop(page, message.data)
                continue
            if page.role == OPERATOR:
                self._runner.hear_operator(time.monotonic())
            if (
                message.type == WSMsgType.TEXT
                and message.data == FRAME_ANSWER
                and page.in_flight > 0
            ):
                page.in_flight -= 1
                page.heard = time.monotonic()
                page.wake.set()
                continue
            if not limit.allows(time.monotonic()) or len(page.commands) > BURST:
                return await self._close(page, WSCloseCode.POLICY_VIOLATION, "too many messages")
            if message.type != WSMsgType.TEXT or page.role != OPERATOR:
                return await self._close(
                    page, WSCloseCode.POLICY_VIOLATION, "this page may only stop"
                )
            page.commands.append(message.data)
            page.commanded.set()

    def _stop(self, page: Page, text: str) -> None:
        self._runner.stop(f"{page.role}'s page")
        for other in self._pages:
            other.commands.clear()
        with contextlib.suppress(MalformedMessageError, CommandError):
            page.answers.append(_text(messages.Answer(parse(text).number, True)))
        page.wake.set()

    async def _work_through(self, page: Page) -> None:
        """Carry out a page's commands one after the other."""
        while True:
            await page.commanded.wait()
            page.commanded.clear()
            while page.commands:
                try:
                    answer = await self._carry_out(page, page.commands.popleft())
                except MalformedMessageError as error:
                    return await self._close(page, WSCloseCode.POLICY_VIOLATION, str(error))
                page.answers.append(_text(answer))
                self._look_for_change()
                for other in self._pages:
                    other.wake.set()

    async def _carry_out(self, page: Page, text: str) -> messages.Answer:
        number = -1
        try:
            command = parse(text)
            number = command.number
            if command.name == "claim":
                self._commander = page
            elif self._commander is not page and command.name not in FREE_COMMANDS:
                raise CommandError(
                    "another page is in command; take over first"
                    if self._commander is not None
                    else "this page is not in command; take command first"
                )
            else:
                await asyncio.wrap_future(self._runner.submit(command))
        except RefusedCommandError as error:
            return messages.Answer(error.number, False, str(error))
        except CommandError as error:
            return messages.Answer(number, False, str(error))
        return messages.Answer(number, True)

    async def _close(self, page: Page, code: WSCloseCode, reason: str) -> None:
        self.closed_for_cause += 1
        self._pages.discard(page)
        _logger.warning("a page (%s) was closed: %s", page.role, reason)
        with contextlib.suppress(Exception):
            await asyncio.wait_for(page.socket.close(code=code, message=reason.encode()[:120]), 1.0)


def _is_stop(text: str) -> bool:
    """Return whether a page's message is a stop: the word, or the command, whatever else it
    says.
    """
    if text == STOP:
        return True
    if len(text) > LONGEST_MESSAGE or '"stop"' not in text:
        return False
    with contextlib.suppress(ValueError, RecursionError):
        content = json.loads(text)
        return isinstance(content, dict) and content.get("command") == STOP
    return False


def _text(message: Any) -> str:
    return json.dumps(dataclasses.asdict(message), separators=(",", ":"), allow_nan=False)
