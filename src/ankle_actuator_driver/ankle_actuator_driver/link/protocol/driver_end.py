"""The driver's end of the protocol: orders become packets, packets become reports in ROS time.

Knows no socket; every call says what time it is. docs/rig_protocol.md is the specification.
"""

from __future__ import annotations

import math
import secrets
from collections import Counter

import numpy as np

from ankle_actuator_driver.link.protocol.device_clock import DeviceClock
from ankle_actuator_driver.link.protocol.packet import (
    LARGEST_COUNT,
    Heartbeat,
    Packet,
    Reference,
    Refusal,
    StateReport,
    newer,
    parse,
    sealed,
    unsealed,
)
from ankle_actuator_driver.safety.rig import (
    UNPOWERED,
    Event,
    Interruption,
    Order,
    Remark,
    RigReport,
    Stretch,
    Wanted,
)
from ankle_actuator_driver.safety.watchdog import Watchdog

REFERENCE_SAMPLES = 32
"""Number of reference samples in a packet: one block of 2048 Hz at 64 Hz."""
assert REFERENCE_SAMPLES <= LARGEST_COUNT
SEQUENCE_STRIDE = 64
"""Step of the sequence number from one order to the next: numbers in between are for heartbeats
that another process sends meanwhile, at most one every 20 ms for 100 ms."""
LARGEST_AGE = 2.0
"""[s] Largest time between a report's first sample and its sending: with more it is refused."""
LARGEST_LEAD = 0.001
"""[s] Time by which a report's last sample may be later than its sending: nothing is measured
before its time, but a rig may read its clock for the two a sample apart."""
OTHER_DRIVER_SILENCE = 1.0
"""[s] Time without a word from the driver that the rig obeys after which another one may take an
unpowered rig: ten times what costs that driver a running plate."""
CLOCK_LEAP = 1.0
"""[s] Time by which the rig's clock may leave ROS time between two packets before it counts as set.
"""


def draw_session() -> int:
    """Return the number of a driver's session, at random, not 0."""
    return secrets.randbelow(2**32 - 1) + 1


class DriverEnd:
    """Makes packets of orders, and reports of packets: the driver's end of the protocol.

    Parameters
    ----------
    session
        Number of the session with the rig, not 0. Where another driver has taken the rig and
        fallen silent, a new number is drawn, because the rig obeys no former session again.
    key
        Shared with the rig; empty for none.

    Attributes
    ----------
    clock
        The rig's clock.
    refusals
        Packets from the rig that were refused, by reason.
    missing
        Samples lost on the way from the rig.
    undated
        Samples that came while the rig's clock was not known.
    rig_refused
        Packets that the rig refused.
    """

    def __init__(self, session: int, key: bytes = b"") -> None:
        self.clock = DeviceClock()
        self.refusals: Counter[Refusal] = Counter()
        self.missing = 0
        self.undated = 0
        self.rig_refused = 0
        self._session, self._key = session, key
        self._sequence = 0
        self._wanted, self._changed_at = Wanted.OFF, 0
        self._last: StateReport | None = None
        self._last_at = (0.0, 0.0)  # steady clock and ROS time of the last packet [s]
        self._heard = Watchdog()
        self._other_driver = (0, 0)  # session and sequence of another one that the rig obeys
        self._other_driver_heard = 0.0  # steady clock [s]
        # The rig's time at which its next sample is due [s].
        self._next_first: float | None = None

    def restart_clock(self) -> None:
        """Measure the rig's clock anew, because ROS time was set."""
        self.clock.restart()
        self._next_first = None

    def unsealed(self, order: Order, now: float, ros: float) -> list[bytes]:
        """Return the packets of an order without digests, so that the sender can renumber them."""
        if order.stretch is None or not self.clock.ready:
            return [unsealed(Heartbeat(*self._head(order, now, ros)))]
        return self._references(order, order.stretch, now, ros)

    def packets(self, order: Order, now: float, ros: float) -> list[bytes]:
        """Return the packets of an order."""
        return [sealed(data, self._key) for data in self.unsealed(order, now, ros)]

    def _head(
        self, order: Order, now: float, ros: float
    ) -> tuple[int, int, int, Wanted, int, int, int]:
        self._sequence = (self._sequence + SEQUENCE_STRIDE) % 2**32
        if order.wanted is not self._wanted:
            self._wanted, self._changed_at = order.wanted, self._sequence
        last = self._last
        # A driver that does not hear its rig greets whoever is there now, but only to switch off.
        greets = last is None or (order.wanted is Wanted.OFF and self._heard.expired(now))
        return (
            self._session,
            self._sequence,
            round(ros * 1e9),
            order.wanted if last is not None else Wanted.OFF,
            order.resets,
            last.sequence if last is not None else 0,
            0 if greets or last is None else last.session,
        )

    def _references(self, order: Order, stretch: Stretch, now: float, ros: float) -> list[bytes]:
        time, motion = stretch.time, stretch.motion
        first, end = self.clock.to_device(float(time[0])), self.clock.to_device(float(time[-1]))
        interval = (end - first) / (len(time) - 1)
        return [
            unsealed(
                Reference(
                    *self._head(order, now, ros),
                    round((first + k * interval) * 1e9),
                    interval,
                    motion[k : k + REFERENCE_SAMPLES],
                )
            )
            for k in range(0, len(time), REFERENCE_SAMPLES)
        ]

    def take(self, data: bytes, now: float, ros: float) -> list[Event]:
        """Read bytes from the line; the result is empty where they are refused.

        Refused bytes are counted.
        """
        packet = parse(data, self._key)
        events: list[Event] = []
        if isinstance(packet, Heartbeat):
            packet = Refusal.DIRECTION
        if isinstance(packet, StateReport):
            packet = self._in_turn(packet, now, events)
        if not isinstance(packet, Refusal) and (reason := self._out_of_time(packet, ros)):
            packet = reason
        if isinstance(packet, Refusal):
            self.refusals[packet] += 1
            return events
        self._heard.feed(now)
        if self._other_driver_is_gone(packet, now):
            self._session = draw_session()
            events.append(
                Remark("the rig's other driver has fallen silent; this driver takes the rig again")
            )
        ours = packet.host == self._session
        events += self._follow_clock(packet, ours, now, ros)
        self._last, self._last_at, self.rig_refused = packet, (now, ros), packet.refused
        time, samples = self._dated(packet, events)
        events.append(
            RigReport(
                packet.state,
                packet.fault,
                packet.status,
                ours,
                ours and not newer(self._changed_at, packet.heard),
                self.clock.ready,
                packet.commanded,
                time,
                samples,
                len(packet.samples),
            )
        )
        return events

    def _in_turn(
        self, packet: StateReport, now: float, events: list[Event]
    ) -> StateReport | Refusal:
        """Return whether a packet is of the rig that is heard, and newer than the last one."""
        last = self._last
        if last is None:
            return packet
        if packet.session == last.session:
            return packet if newer(packet.sequence, last.sequence) else Refusal.OLD
        if not self._heard.expired(now):
            return Refusal.SESSION
        self.restart_clock()
        self._last = None
        events.append(Interruption("the rig has started anew"))
        return packet

    def _other_driver_is_gone(self, packet: StateReport, now: float) -> bool:
        """Return whether the rig, at rest and not wanted otherwise, obeys a driver that says
        nothing any more; once for each silence.
        """
        other = packet.host, packet.heard
        if packet.host in (0, self._session) or other != self._other_driver:
            self._other_driver, self._other_driver_heard = other, now
            return False
        silent = now - self._other_driver_heard > OTHER_DRIVER_SILENCE
        gone = silent and packet.state in UNPOWERED and self._wanted is Wanted.OFF
        if gone:
            self._other_driver_heard = now
        return gone

    @staticmethod
    def _out_of_time(packet: Packet, ros: float) -> Refusal | None:
        """Return whether the times in a packet cannot be."""
        assert isinstance(packet, StateReport)
        age = 1e-9 * (packet.sent - packet.first)
        lead = (len(packet.samples) - 1) * packet.interval - age
        if not (age < LARGEST_AGE and lead < LARGEST_LEAD):
            return Refusal.TIME
        ahead = packet.echo - ros * 1e9
        return Refusal.TIME if packet.host and ahead > 1e9 * CLOCK_LEAP else None

    def _follow_clock(self, packet: StateReport, ours: bool, now: float, ros: float) -> list[Event]:
        note = None
        if self._last is not None:
            passed = 1e-9 * (packet.sent - self._last.sent)
            leap = passed - (now - self._last_at[0])
            if abs(leap) > CLOCK_LEAP:
                self.clock.restart()
                note = (
                    f"the rig's clock was set by {leap:+.3g} s"
                    if leap > 0.0
                    else f"the rig's packets came {-leap:.3g} s late: this computer held the "
                    "driver up, or the rig's clock was set back"
                )
        if note is None:
            echo = 1e-9 * packet.echo if ours else math.nan
            note = self.clock.exchange(1e-9 * packet.sent, ros, echo, 1e-9 * packet.echo_received)
        if note is None:
            return []
        self._next_first = None
        return [Interruption(note)]

    def _dated(self, packet: StateReport, events: list[Event]) -> tuple[np.ndarray, np.ndarray]:
        """Return the samples of a packet with their ROS times, shapes (n,) and (n, 3)."""
        count = len(packet.samples)
        nothing = np.empty(0), np.empty((0, 3))
        if not count or not self.clock.ready:
            self.undated += count
            return nothing
        first = 1e-9 * packet.first
        if self._next_first is not None:
            lost = round((first - self._next_first) / packet.interval)
            if lost < 0:
                self.refusals[Refusal.TIME] += 1
                return nothing
            if lost:
                self.missing += lost
                events.append(
                    Remark(
                        f"{lost} samples ({lost * packet.interval:.3f} s) from the rig were lost "
                        "on the way"
                    )
                )
        self._next_first = first + count * packet.interval
        start, end = self.clock.to_ros(first), self.clock.to_ros(self._next_first)
        return start + (end - start) * np.arange(count) / count, packet.samples
