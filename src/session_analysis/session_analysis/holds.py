"""Hold periods of a session, from the events that mark them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from ankle_node.session_event import HOLD_ENDED, HOLD_STARTED, TORQUE_TARGET, SessionEvent

SHORTEST_HOLD = 50.0
"""[s] Shortest hold that is used: the paper's last 60 s, and with fewer than about 80 stretches the
mean of a reflex (30 % variation from stretch to stretch) is less sure than 3 %."""


@dataclass(frozen=True)
class Hold:
    """Describes a stretch of time in which the subject kept one state.

    Attributes
    ----------
    number
        As the session counts them.
    start, end
        [s].
    target
        Torque target [N.m], as the event names it.
    """

    number: int
    start: float
    end: float
    target: float


@dataclass(frozen=True)
class Excluded:
    """Names something that is left out, and why."""

    what: str
    reason: str


def find_holds(events: Iterable[SessionEvent]) -> tuple[list[Hold], list[Excluded]]:
    """Find complete holds in the order of time, and those that are left out.

    A hold begins with ``hold started``, which says its number and torque target, and ends with the
    next ``hold ended``.
    """
    holds: list[Hold] = []
    excluded: list[Excluded] = []
    begun: SessionEvent | None = None
    for event in sorted(events, key=lambda event: event.time):
        if event.event not in (HOLD_STARTED, HOLD_ENDED):
            continue
        if begun is None:
            if event.event == HOLD_STARTED:
                begun = event
            else:
                number = event.details.get("hold", "")
                excluded.append(
                    Excluded(
                        f"{f'hold {number}'.strip()} ending at t = {event.time:.1f} s",
                        "its start is not in the recording",
                    )
                )
            continue
        number = begun.details.get("hold", len(holds) + len(excluded) + 1)
        what = f"hold {number} at t = {begun.time:.1f} s"
        if event.event == HOLD_STARTED:
            excluded.append(Excluded(what, "it has no end"))
            begun = event
            continue
        target = begun.details.get(TORQUE_TARGET)
        length = event.time - begun.time
        if isinstance(target, bool) or not isinstance(target, (int, float)):
            excluded.append(Excluded(what, f"its event says no {TORQUE_TARGET}"))
        elif length < SHORTEST_HOLD:
            excluded.append(
                Excluded(what, f"it lasted {length:.1f} s, less than {SHORTEST_HOLD:g} s")
            )
        else:
            holds.append(Hold(int(number), begun.time, event.time, float(target)))
        begun = None
    if begun is not None:
        excluded.append(
            Excluded(
                f"hold {begun.details.get('hold', '?')} at t = {begun.time:.1f} s", "it has no end"
            )
        )
    return holds, excluded
