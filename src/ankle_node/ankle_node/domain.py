"""Where the nodes of this process look for others: on this computer alone unless the environment
says otherwise, and, for tests, demo and benchmarks, in a ROS domain that no other process uses.

A domain that another process uses would bring a second publisher of every topic.
"""

from __future__ import annotations

import fcntl
import os
import random
import tempfile
from collections.abc import MutableMapping
from pathlib import Path
from typing import TextIO

DOMAINS = range(1, 101)
"""Domains to choose from, without 0, which everybody uses; from 102 on the ports reach those that
Linux hands out."""
PORT_BASE, PORTS_PER_DOMAIN = 7400, 250
"""UDP ports of a domain (DDS-RTPS 2.3, section 9.6.1.1)."""
SOCKET_TABLES = ("/proc/net/udp", "/proc/net/udp6")
VARIABLE = "ROS_DOMAIN_ID"
RANGE_VARIABLE = "ROS_AUTOMATIC_DISCOVERY_RANGE"

_held: list[TextIO] = []


def stay_on_this_host(environment: MutableMapping[str, str] = os.environ) -> None:
    """Keep discovery on this host, unless the environment states another range.

    Parameters
    ----------
    environment
        Of this process, or of one that is to be started.
    """
    environment.setdefault(RANGE_VARIABLE, "LOCALHOST")


def take_free_domain() -> int:
    """Reserve a domain for this process and its children, and set ``ROS_DOMAIN_ID``.

    Returns
    -------
    int
        The domain; it is reserved until the process ends.

    Raises
    ------
    OSError
        Every domain is in use.
    """
    used = used_domains()
    # In any order: two processes that begin at the same time seldom try the same ones.
    for domain in random.sample(DOMAINS, len(DOMAINS)):
        if domain not in used and _reserve(domain):
            os.environ[VARIABLE] = str(domain)
            return domain
    raise OSError(f"no ROS domain from {DOMAINS[0]} to {DOMAINS[-1]} is free on this computer")


def used_domains() -> set[int]:
    """Return the domains in which some process of this computer has a UDP port open."""
    ports = set()
    for table in SOCKET_TABLES:
        if os.path.exists(table):
            lines = Path(table).read_text().splitlines()[1:]
            ports |= {int(line.split()[1].rpartition(":")[2], 16) for line in lines}
    return {(port - PORT_BASE) // PORTS_PER_DOMAIN for port in ports if port >= PORT_BASE}


def _reserve(domain: int) -> bool:
    """Lock the domain's file; whoever locks it first has the domain."""
    path = Path(tempfile.gettempdir()) / f"ankle_ros_domain_{domain}_{os.getuid()}.lock"
    handle = path.open("w")
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        handle.close()
        return False
    _held.append(handle)
    return True
