"""The memory: sums of products of the whitened signals, block by block, in a ring; one ring for
each noise model.
"""

from __future__ import annotations

import numpy as np

from impedance_estimator.compilation import part
from impedance_estimator.simultaneous.nuisance import accumulate, reduce_sums, reducible_size
from impedance_estimator.simultaneous.state import Plan, State


@part
def add_blocks(sums: np.ndarray, ring: np.ndarray, newest: int, first: int, last: int) -> None:
    """Add what is recorded of some blocks, four at a time, one after the other in every sum.

    Parameters
    ----------
    sums
        Shape (k,), added to.
    ring
        What is recorded of every block, shape (capacity, k or more).
    newest
        Index of the newest block in the ring.
    first, last
        The blocks `first` to `last` - 1, counted back from the newest one.
    """
    capacity, back = ring.shape[0], first
    while back + 4 <= last:
        a, b = ring[(newest - back) % capacity], ring[(newest - back - 1) % capacity]
        c, d = ring[(newest - back - 2) % capacity], ring[(newest - back - 3) % capacity]
        for k in range(sums.shape[0]):
            sums[k] = sums[k] + a[k] + b[k] + c[k] + d[k]
        back += 4
    for rest in range(back, last):
        a = ring[(newest - rest) % capacity]
        for k in range(sums.shape[0]):
            sums[k] += a[k]


@part
def sum_memory(s: State, model: int) -> None:
    """Sum the total of one model anew from its blocks."""
    c = s.counters[0]
    total = s.totals[model]
    total[:] = 0.0
    add_blocks(total, s.ring[model], c.newest, 0, c.length)


@part
def blocks_of(p: Plan, s: State, memory: int) -> int:
    """Return how many blocks one of the memories holds that `memory_length` chooses from."""
    c = s.counters[0]
    return min(p.lengths[memory], c.since) if memory < p.lengths.shape[0] else c.kept


@part
def use_chosen_memory(p: Plan, s: State) -> None:
    """Make the totals those of the chosen memory."""
    c = s.counters[0]
    c.length = blocks_of(p, s, c.memory)
    for model in range(s.ring.shape[0]):
        sum_memory(s, model)


@part
def store_block(p: Plan, s: State) -> None:
    """Add the newest block to the memory; the oldest one leaves a memory that is full."""
    c = s.counters[0]
    capacity, signals = s.ring.shape[1], s.signals.shape[0] // 2
    c.newest = (c.newest + 1) % capacity
    c.since = min(c.since + 1, p.memory_blocks)
    c.kept = min(c.kept + 1, p.memory_blocks)
    full = c.length == blocks_of(p, s, c.memory)
    s.stretches[c.newest] = s.stretch
    s.stretch[:] = 0.0
    for model in range(s.ring.shape[0]):
        newest, total = s.ring[model, c.newest], s.totals[model]
        accumulate(newest, s.block[model], signals, c.instrumented == 1)
        if full:
            oldest = s.ring[model, (c.newest - c.length) % capacity]
            for k in range(total.shape[0]):
                total[k] = total[k] - oldest[k] + newest[k]
        else:
            for k in range(total.shape[0]):
                total[k] += newest[k]
    if not full:
        c.length += 1
    c.filled = 0
    c.blocks += 1
    # Adding and subtracting gathers rounding errors: one model after the other is summed anew, each
    # about once in 6 s.
    again = c.blocks % (32 * s.ring.shape[0])
    if again < s.ring.shape[0]:
        sum_memory(s, again)


@part
def recent_sums(s: State, model: int, blocks: int, after: int) -> np.ndarray:
    """Return the recorded sums of the newest blocks, but for the last `after`, under a noise
    model: Z'Z, Z'τ and τ'τ in the order of `nuisance.accumulate`.
    """
    c = s.counters[0]
    sums = np.zeros(reducible_size(s.nuisance.unknowns.shape[1]))
    if after == 0 and blocks == c.length:
        sums[:] = s.totals[model, : sums.shape[0]]
    else:
        add_blocks(sums, s.ring[model], c.newest, after, after + blocks)
    return sums


@part
def normal_matrix(s: State, model: int, blocks: int, after: int) -> np.ndarray:
    """Return the normal matrix of the unknowns, shape (8, 8), over the blocks of `recent_sums`."""
    count = s.nuisance.unknowns.shape[0]
    normal = np.empty((count, count))
    reduce_sums(recent_sums(s, model, blocks, after), s.nuisance.unknowns, normal)
    return normal
