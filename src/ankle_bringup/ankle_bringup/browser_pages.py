"""The pages of a graph's biofeedback node: where they are, whether they are served, shown where
there is a display.
"""

from __future__ import annotations

import os
import socket
import threading
import time
import webbrowser

from ankle_bringup.errors import RunError
from ankle_bringup.graph import Graph
from ankle_bringup.processes import Processes
from biofeedback.parameters import CERTIFICATE, HOST, PORT, TOKEN
from biofeedback.web.access import subject_token

# s; other nodes of a graph compile at their first start and leave little of a small computer
START_PATIENCE = 120.0


def page_addresses(graph: Graph) -> tuple[str, str] | None:
    """Return the addresses of the subject's and the operator's page, without tokens.

    The result is None where the graph has no biofeedback node.
    """
    for node in graph.nodes:
        if node.package == "biofeedback":
            host, port, certificate = (
                node.parameters.get(parameter.name, parameter.default)
                for parameter in (HOST, PORT, CERTIFICATE)
            )
            scheme = "https" if certificate else "http"
            base = f"{scheme}://{host if host != '0.0.0.0' else '127.0.0.1'}:{port}"
            return f"{base}/", f"{base}/operator"
    return None


def _entrances(graph: Graph, addresses: tuple[str, str]) -> tuple[str, ...]:
    """Return what a browser opens: behind # a token stays in the browser and out of every log."""
    token = next(
        str(node.parameters.get(TOKEN.name, TOKEN.default))
        for node in graph.nodes
        if node.package == "biofeedback"
    )
    if not token:
        return addresses
    return tuple(f"{addresses[0]}enter#{secret}" for secret in (subject_token(token), token))


def free_port() -> int:
    """Return a port of this computer that nobody serves."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def is_served(port: int) -> bool:
    """Return whether somebody answers at a port of this computer."""
    try:
        socket.create_connection(("127.0.0.1", port), timeout=1.0).close()
    except OSError:
        return False
    return True


def wait_until_served(port: int, processes: Processes) -> None:
    """Wait for the pages.

    Raises
    ------
    RunError
        A node ended, or nobody answers in time.
    """
    deadline = time.monotonic() + START_PATIENCE
    while not is_served(port):
        processes.ended("")
        if time.monotonic() > deadline:
            raise RunError(
                f"no page on port {port} within {START_PATIENCE:g} s (log: "
                f"{processes.log('biofeedback')})"
            )
        time.sleep(0.2)


def show_pages(graph: Graph) -> None:
    """Open the pages in the browser once they are served, where this computer has a display."""
    addresses = page_addresses(graph)
    if addresses is None or not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return
    port = int(addresses[0].rstrip("/").rpartition(":")[2])

    def wait_and_open() -> None:
        deadline = time.monotonic() + START_PATIENCE
        while not is_served(port):
            if time.monotonic() > deadline:
                return
            time.sleep(0.5)
        for address in _entrances(graph, addresses):
            webbrowser.open(address)

    threading.Thread(target=wait_and_open, daemon=True).start()
