"""Watches during a session whether the base model still fits as it did in the first minute.

| topic | type | |
| --- | --- | --- |
| `ankle/samples` | Float64MultiArray | in: t, position, torque, and velocity where it is measured |
| `/diagnostics` | DiagnosticArray | out: VAF, predictable share of the residual, what got worse |
"""

from __future__ import annotations

import queue
import sys
import threading
import time
from functools import partial

import numpy as np

from ankle_interfaces.block import Block
from ankle_interfaces.continuity import Finding
from ankle_interfaces.topics import ANKLE_SAMPLES
from ankle_node.node import OK, WARN, AnkleNode, run
from model_discrepancy.fit.parallel import in_background
from model_discrepancy.live_parameters import PARAMETERS, PERIOD, SHARE_RISE, VAF_FALL, WINDOW
from model_discrepancy.session_watch import Indicators, RecentSamples, SessionWatch

REQUIRED_COLUMNS, OPTIONAL = ("position[rad]", "torque[N.m]"), ("velocity[rad/s]",)
# A hole of this length [s] cannot be bridged: a reflex response lasts about as long.
LONGEST_GAP = 0.4
# `health` shows a warning for ten seconds, and a fit may come minutes later.
WARNING_PERIOD = 5.0  # s


class ModelDiscrepancy(AnkleNode):
    """Keeps the last samples and has a thread fit them; the thread's results are shown from the
    node's own thread.
    """

    def __init__(self) -> None:
        super().__init__("model_discrepancy", PARAMETERS)
        self._recent = RecentSamples(self.number(WINDOW.name))
        self._due = self.number(WINDOW.name)
        self._first: float | None = None
        self._last = -np.inf
        self._fits = 0
        self._skipped = 0
        self._complaint: str | None = None
        # One window at a time: those that fall due meanwhile are counted, and the newest is fitted
        # next.
        self._waiting = False
        self._work: queue.Queue[np.ndarray] = queue.Queue(maxsize=1)
        self._busy = threading.Event()
        self._results: queue.Queue[tuple[Indicators, Indicators | None, str | None] | Exception] = (
            queue.Queue()
        )
        threading.Thread(target=self._fit, daemon=True).start()
        self.count("state", "waiting for samples")
        self.block_subscription(ANKLE_SAMPLES, self._receive, REQUIRED_COLUMNS, OPTIONAL)
        self.create_timer(0.2, self._show)
        self.create_timer(WARNING_PERIOD, self._remind)

    def _receive(self, block: Block, findings: list[Finding]) -> None:
        samples = block.data
        start, end = float(samples[0, 0]), float(samples[-1, 0])
        if not self._last - 1.0 < start < self._last + LONGEST_GAP:
            self._recent.clear()
            self._first = start
            self._due = start + self._recent.window
        self._recent.add(samples)
        self._last = end
        if end >= self._due:
            self._due = end + self.number(PERIOD.name)
            self._hand_over_window()

    def _hand_over_window(self) -> None:
        samples = self._recent.snapshot()
        if samples is None:
            return
        if self._busy.is_set():
            self._skipped += self._waiting
            self._waiting = True
            self.count("windows left out while fitting", self._skipped)
            return
        self._waiting = False
        self._busy.set()
        self._work.put(samples)

    def _fit(self) -> None:
        """Judge one window after the other."""
        watch = SessionWatch()
        while True:
            samples = self._work.get()
            begun = time.monotonic()
            try:
                now, complaint = in_background(partial(self._judged, watch, samples))
                self._results.put((now, watch.reference, complaint))
                self.get_logger().debug(f"fitted in {time.monotonic() - begun:.1f} s")
            except (ValueError, np.linalg.LinAlgError) as error:
                self._results.put(error)
            self._busy.clear()

    def _judged(self, watch: SessionWatch, samples: np.ndarray) -> tuple[Indicators, str | None]:
        """Return what a window shows, and what got worse."""
        now = watch.judge(samples)
        limits = self.number(VAF_FALL.name), self.number(SHARE_RISE.name)
        return now, watch.complaint(now, *limits)

    def _show(self) -> None:
        while not self._results.empty():
            result = self._results.get()
            self._fits += 1
            self.count("fits", self._fits)
            if isinstance(result, Exception):
                self._complaint = f"the window could not be fitted: {result}"
            else:
                now, reference, self._complaint = result
                self.count(
                    "state", "watching" if reference else "waiting for a window that can be judged"
                )
                self.count("vaf_base[%]", round(now.vaf, 2))
                self.count("predictable_share[1]", round(now.share, 4))
                if reference is not None:
                    self.count("vaf_base_at_start[%]", round(reference.vaf, 2))
                    self.count("predictable_share_at_start[1]", round(reference.share, 4))
            if self._complaint:
                self.get_logger().warning(self._complaint)
            self._remind()
        if self._waiting and not self._busy.is_set():
            self._hand_over_window()

    def _remind(self) -> None:
        self.health(
            "model", WARN if self._complaint else OK, self._complaint or "fits as at the start"
        )


def main() -> None:
    """Start the node: the entry point of ``ros2 run model_discrepancy model_discrepancy``."""
    sys.exit(run(ModelDiscrepancy))
