"""The holds of a session, as in van 't Veld et al. 2018, section III-B.2.

Perturbations in blocks of 10 minutes with breaks; for each novel state the subject first goes to it
and then holds it for 60 s, at a torque target of 0 or -5 N.m.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ankle_sim.virtual_subject import State

HOLD = 60.0
"""[s] Length of a hold (paper)."""
APPROACH_TIME = 60.0
"""The next hold begins so long [s] after the end of the last: the estimates can follow (rise
time of K 16 s), and with it 18 holds fill the paper's four blocks.
"""
BLOCK = 600.0
"""Perturbations last so long [s] without a break (paper: 10 to 12.5 minutes)."""
BREAK = 150.0
"""A break between blocks lasts so long [s] (paper: 2.5 to 5 minutes)."""
TARGETS = (0.0, -5.0)
"""[N.m] Torque targets (paper); negative: the subject pushes towards plantarflexion."""
PAPER_HOLDS = ((11, 7), (11, 7), (11, 8))
"""Holds at each target for each of three subjects: 33 and 22 in all (paper, table III)."""


@dataclass(frozen=True)
class PlannedHold:
    """Describes one hold of the session.

    Attributes
    ----------
    number
        Counted from 1.
    reach
        When the subject sets out for the state [s since the first sample].
    start, end
        Of the hold [s since the first sample].
    target
        Torque target [N.m].
    state
        That is held.
    """

    number: int
    reach: float
    start: float
    end: float
    target: float
    state: State


def plan(
    counts: tuple[int, int],
    seed: int,
    modulates: bool = True,
    hold: float = HOLD,
    reach: float = APPROACH_TIME,
) -> list[PlannedHold]:
    """Return holds in random order, as many in a block as it has room for.

    Parameters
    ----------
    counts
        Holds at each of `TARGETS`.
    seed
        Of states and order.
    modulates
        Whether the subject can change stiffness and reflex; else every hold has the same state at a
        target.
    hold, reach
        Durations of a hold and of the way to it [s].
    """
    random = np.random.default_rng([6_173, seed])
    wanted = []
    for target, count in zip(TARGETS, counts, strict=True):
        # One state in each part of the range, in random order: a session looks for states that were
        # not there before.
        cocontraction, excitability = (
            (random.permutation(count) + random.uniform(size=count)) / max(count, 1)
            for _ in range(2)
        )
        for c, e in zip(cocontraction, excitability, strict=True):
            state = State(float(c), float(e), -target) if modulates else State(push=-target)
            wanted.append((target, state))
    each = max(int(BLOCK // (hold + reach)), 1)
    planned = []
    for index, place in enumerate(random.permutation(len(wanted))):
        block, position = divmod(index, each)
        begin = block * (BLOCK + BREAK) + position * (hold + reach)
        target, state = wanted[place]
        planned.append(
            PlannedHold(index + 1, begin, begin + reach, begin + reach + hold, target, state)
        )
    return planned


def some_holds(count: int, seed: int, hold: float, reach: float) -> list[PlannedHold]:
    """Return a shorter session: `count` holds of `hold` seconds, one third of them at -5 N.m as in
    the paper.
    """
    return plan((count - count // 3, count // 3), seed, hold=hold, reach=reach)
