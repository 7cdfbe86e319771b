"""The signals of the graph that the session reads: subscriptions that feed `LiveSignals`."""

from __future__ import annotations

import time

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray

from ankle_interfaces.block import Block
from ankle_interfaces.continuity import Finding
from ankle_interfaces.topics import (
    ANKLE_SAMPLES,
    DIAGNOSTICS,
    EMG_RESPONSES,
    EMG_SAMPLES,
    IMPEDANCE_ESTIMATE,
)
from ankle_node.node import AnkleNode
from biofeedback.live_signals import LiveSignals

ESTIMATE = ("K[N.m/rad]", "G[N.m.s/rad]", "valid[1]")
"""Columns of the estimates that move the cursor."""
DIAGNOSTICS_KEPT = 50
"""Depth of the queue of ``/diagnostics``: every node reports once a second, and at once what is
wrong."""


class GraphSignals:
    """Subscribes a node to what its session reads.

    Parameters
    ----------
    node
        The node that subscribes.
    signals
        Where the signals go.
    responses
        Whether the session reads the responses of the muscles, as a conditioning course does.
    """

    def __init__(self, node: AnkleNode, signals: LiveSignals, responses: bool) -> None:
        self._signals = signals
        self._laboratory = node.get_namespace().rstrip("/")
        self._ankle = node.block_subscription(ANKLE_SAMPLES, self._take_samples)
        node.block_subscription(IMPEDANCE_ESTIMATE, self._take_estimates, ESTIMATE)
        self._emg = node.block_subscription(EMG_SAMPLES, self._take_emg)
        if responses:
            node.block_subscription(EMG_RESPONSES, self._take_responses)
        node.create_subscription(
            DiagnosticArray, DIAGNOSTICS.name, self._take_diagnostics, DIAGNOSTICS_KEPT
        )

    def _take_samples(self, block: Block, findings: list[Finding]) -> None:
        if not (len(block.data) and self._ankle.rate):
            return
        velocity = (
            block.column("velocity[rad/s]")
            if block.has("velocity[rad/s]")
            else np.zeros(len(block.data))
        )
        columns = (block.time, block.column("position[rad]"), velocity, block.column("torque[N.m]"))
        self._signals.feed_samples(np.column_stack(columns), self._ankle.rate, time.monotonic())

    def _take_estimates(self, block: Block, findings: list[Finding]) -> None:
        self._signals.feed_estimates(block.data, time.monotonic())

    def _take_emg(self, block: Block, findings: list[Finding]) -> None:
        if self._emg.rate:
            self._signals.feed_emg(block.data, self._emg.rate, time.monotonic())

    def _take_responses(self, block: Block, findings: list[Finding]) -> None:
        self._signals.feed_responses(block.data)

    def _take_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            owner, slash, name = status.name.rpartition("/")
            if slash and owner != self._laboratory:
                continue
            figures = {value.key: value.value for value in status.values}
            self._signals.feed_status(
                name, status.level[0], status.message, figures, time.monotonic()
            )
