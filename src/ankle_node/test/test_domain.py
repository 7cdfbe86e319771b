"""ROS domains that are free on this computer."""

import os
import socket
import subprocess
import sys

from ankle_node import domain

TAKE = """
from ankle_node.domain import take_free_domain
print(take_free_domain(), flush=True)
input()
"""


def test_two_processes_take_two_domains(monkeypatch):
    monkeypatch.setenv(domain.VARIABLE, "0")
    # With two domains to choose from, each of two processes has to take its own. Nobody else takes
    # these: their ports lie above those that Linux hands out.
    two = f"from ankle_node import domain; domain.DOMAINS = range(220, 222)\n{TAKE}"
    others = [
        subprocess.Popen(
            [sys.executable, "-c", two], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        for _ in range(2)
    ]
    try:
        assert sorted(int(other.stdout.readline()) for other in others) == [220, 221]
    finally:
        for other in others:
            other.communicate("\n", timeout=20)


def test_discovery_stays_on_this_host_unless_the_environment_says_otherwise():
    environment = {}
    domain.stay_on_this_host(environment)
    assert environment == {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
    domain.stay_on_this_host(environment)
    assert environment == {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}


def test_a_domain_whose_ports_are_open_is_used():
    # Other tests use domains meanwhile.
    free = max(set(domain.DOMAINS) - set(domain.used_domains()))
    port = domain.PORT_BASE + free * domain.PORTS_PER_DOMAIN + 10
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        line.bind(("127.0.0.1", port))
        assert free in domain.used_domains()
    assert free not in domain.used_domains()


def test_the_tests_run_in_a_domain_of_their_own():
    assert int(os.environ[domain.VARIABLE]) in domain.DOMAINS
