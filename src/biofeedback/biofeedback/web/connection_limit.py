"""A limit on open connections, so that nobody can use them up for the others.

A page holds one connection (its WebSocket); everything else is short. Where there are too many, the
oldest that holds no page is closed, so a client that opens thousands and says nothing only loses
its own.
"""

from __future__ import annotations

import asyncio
import logging
from typing import Any

from aiohttp import web

LIMIT = 64
"""Largest number of connections: twenty pages and what they load at the start."""
KEEP_ALIVE = 15.0
"""[s] Time for which a connection may stay without a request."""


_DISABLED_LOGGER = logging.getLogger(f"{__name__}.access")
_DISABLED_LOGGER.disabled = True


class ConnectionLimit:
    """Makes a server's protocols and follows their connections.

    Parameters
    ----------
    server
        That handles the requests.
    limit
        How many connections may be open.

    Attributes
    ----------
    closed
        Connections closed because there were too many.
    """

    def __init__(self, server: web.Server, limit: int = LIMIT) -> None:
        self._server = server
        self._limit = limit
        self._open: dict[asyncio.BaseTransport, None] = {}
        self._pages: set[asyncio.BaseTransport] = set()
        self.closed = 0

    def __call__(self) -> asyncio.Protocol:
        """Return the protocol of a new connection."""
        return _Counted(self, self._server)

    def hold(self, transport: asyncio.BaseTransport | None) -> None:
        """Note that a connection is a page's, so that it is not closed for the sake of others."""
        if transport is not None:
            self._pages.add(transport)

    def made(self, transport: asyncio.BaseTransport) -> None:
        """Note a new connection; the oldest are closed where there are too many."""
        self._open[transport] = None
        while len(self._open) > self._limit:
            # Where all are pages the newcomer goes.
            oldest = next((one for one in self._open if one not in self._pages), transport)
            self.lost(oldest)
            self.closed += 1
            oldest.abort()  # type: ignore[attr-defined]

    def lost(self, transport: asyncio.BaseTransport | None) -> None:
        """Note that a connection is gone."""
        if transport is not None:
            self._open.pop(transport, None)
            self._pages.discard(transport)


class _Counted(web.RequestHandler):
    """Extends aiohttp's protocol: it reports when its connection opens and closes."""

    def __init__(self, limit: ConnectionLimit, server: web.Server) -> None:
        super().__init__(
            server,
            loop=asyncio.get_running_loop(),
            access_log=_DISABLED_LOGGER,
            keepalive_timeout=KEEP_ALIVE,
        )
        self._limit = limit

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        self._limit.made(transport)

    def connection_lost(self, exc: BaseException | None) -> None:
        self._limit.lost(self.transport)
        super().connection_lost(exc)
