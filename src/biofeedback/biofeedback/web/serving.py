"""The thread in which the pages are served, and the addresses under which they are found."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from pathlib import Path

from biofeedback.session.saved_session import write_private
from biofeedback.web.access import Access, is_loopback
from biofeedback.web.server import Server

START_PATIENCE = 10.0
"""[s] Longest wait for the pages to be there."""
END_PATIENCE = 5.0
"""[s] Longest wait for the server to close."""


class Serving:
    """Serves pages in a thread of its own.

    Parameters
    ----------
    server
        The server of the pages.
    host, port
        Address; port 0 takes a free one.
    on_ready
        Called with the port in that thread, before `start` returns.
    on_failure
        Called in that thread after the server has failed; `failure` then holds the error.

    Attributes
    ----------
    failure
        The error that ended the server; None without one.
    """

    def __init__(
        self,
        server: Server,
        host: str,
        port: int,
        on_ready: Callable[[int], None],
        on_failure: Callable[[], object],
    ) -> None:
        self._server, self._host, self._port = server, host, port
        self._on_ready, self._on_failure = on_ready, on_failure
        self.failure: Exception | None = None
        self._loop, self._stopped = asyncio.new_event_loop(), asyncio.Event()
        self._settled = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="pages", daemon=True)

    def start(self) -> None:
        """Serve; return once the pages are there.

        Raises
        ------
        Exception
            Of the server, as an address that cannot be had; or it was not there in time.
        """
        self._thread.start()
        if not self._settled.wait(START_PATIENCE) or self.failure is not None:
            raise self.failure or OSError(f"the pages were not there within {START_PATIENCE:g} s")

    def _serve(self) -> None:
        asyncio.set_event_loop(self._loop)

        def ready(port: int) -> None:
            self._on_ready(port)
            self._settled.set()

        try:
            self._loop.run_until_complete(
                self._server.run(self._host, self._port, ready, self._stopped)
            )
        except Exception as error:
            self.failure = error
            self._settled.set()
            self._on_failure()

    def close(self) -> None:
        """Close the pages and end the thread."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._stopped.set)
            self._thread.join(timeout=END_PATIENCE)


def addresses(access: Access, host: str, port: int, secure: bool, links: Path) -> list[str]:
    """Return where the pages are, one sentence each.

    Parameters
    ----------
    access
        Where it needs tokens, the addresses with them are written to `links`.
    host, port
        Host and port of the server.
    secure
        Whether the pages are served over TLS.
    links
        A file that only its owner may read.

    Raises
    ------
    OSError
        The disk refuses.
    """
    scheme = "https" if secure else "http"
    shown = host if is_loopback(host) else f"{host} (or this computer's name)"
    base = f"{scheme}://{shown}:{port}"
    sentences = [f"subject's screen: {base}/   operator's page: {base}/operator"]
    if access.needs_token:
        lines = [f"{role}: {base}/enter#{token}\n" for role, token in access.tokens().items()]
        write_private(links, "".join(lines))
        sentences.append(f"the addresses with their tokens are in {links}")
    return sentences
