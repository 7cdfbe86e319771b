"""The difference between a simulated and a recorded bag: how large, where, and what makes it.

Where both made the same movement, the torques are subtracted. Otherwise a description learnt from
the simulated bag (its best model, and the generic bank for what that leaves) is driven by the
recorded movement, and its torque is subtracted from the recorded one. What makes the difference is
told from the model fitted to each bag: of every term the torque that changes on the recorded
movement when the simulated bag's values of that term are put in.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.signal import correlate

from ankle_physics.joint_profile import joint_in_force
from ankle_physics.term import term_library
from model_discrepancy.criticism.locate import residual_map
from model_discrepancy.criticism.missing_block import missing_block
from model_discrepancy.criticism.remainder import remainder
from model_discrepancy.fit.columns import Columns
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import MATERIAL_SHARE, Fitter
from model_discrepancy.fit.generic_bank import GenericBank
from model_discrepancy.fit.halves import interleaved
from model_discrepancy.fit.held_out import vaf
from model_discrepancy.fit.parallel import side_by_side
from model_discrepancy.fit.rows import Rows
from model_discrepancy.fit.standard_errors import with_errors
from model_discrepancy.problem import prepare
from model_discrepancy.recording.channel_quality import (
    FollowingResponse,
    following_response,
    noise_levels,
)
from model_discrepancy.recording.motion import Motion
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.recording_checks import SHORTEST_S, faults
from model_discrepancy.search.null import Null
from model_discrepancy.search.term_search import search
from model_discrepancy.tools.comparison_result import Comparison, Contribution, Side

# Movements that differ by less than this share of their variance are the same: below it position
# noise of 20 dB would hide a difference.
LARGEST_MOVEMENT_DIFFERENCE = 0.01
# Significant differences of the actuator: of bandwidth and gain as a ratio, of delay [s].
LEAST_BANDWIDTH_RATIO = 1.1
LEAST_GAIN_RATIO = 1.03
LEAST_DELAY_S = 0.002
# Movements larger than those that the description was learnt from are extrapolated.
_EXTRAPOLATION_RATIO = 1.2


def compare(
    simulated: Recording, recorded: Recording, progress: Callable[[str], None] = lambda _: None
) -> Comparison:
    """Localise the difference between two recordings, by the ranges and the base model of the joint
    in force.

    Parameters
    ----------
    simulated, recorded
        Torque and movement of each.
    progress
        Called with one line for each step.
    """
    names = (simulated.name, recorded.name)
    reasons = [
        f"{which}: {fault}"
        for which, r in (("simulated", simulated), ("recorded", recorded))
        for fault in faults(r)
    ]
    if reasons:
        return Comparison(names, "bad_recording", reasons)
    with side_by_side():
        first = _side(simulated, None, lambda line: progress(f"simulated bag: {line}"))
        second = _side(recorded, first.found.final, lambda line: progress(f"recorded bag: {line}"))
    progress("subtracting")
    fitter, notes = second.fitter, []
    together = aligned(first.motion, second.motion)
    if together is not None:
        method = "torques subtracted: both bags hold the same movement"
        fitter, left = _subtracted(*together, second)
    else:
        method = "the recorded movement drives a description learnt from the simulated bag"
        left = fitter.columns.target - _described(first, fitter)
        notes += _extrapolation(first, second)
    difference = fitter.rows.plain(left)
    used = fitter.rows.used
    whitened = fitter.rows.whitened(left)
    as_fit = Fit({}, whitened, left, fitter.rows, float(whitened[used] @ whitened[used]), 0)
    contributions = _contributions(first.found.final, second)
    result = Comparison(
        names,
        "agree",
        [
            *notes,
            *(f"simulated: {n}" for n in simulated.notes),
            *(f"recorded: {n}" for n in recorded.notes),
        ],
        (first, second),
        method,
        difference,
        float(np.std(difference[used])),
        vaf(fitter.plain_target[used], difference[used]),
        residual_map(fitter.columns, as_fit),
        contributions,
        _actuator_differences(first.following, second.following),
    )
    _conclude(result, second)
    return result


def _side(recording: Recording, start: Fit | None, progress: Callable[[str], None]) -> Side:
    """Fit one bag: the base model, then whatever else it holds, beginning with the terms of
    `start`.
    """
    problem = prepare(recording, joint_in_force().terms, progress)
    fitter = problem.fitter
    base = with_errors(fitter, problem.base)
    known = base
    if start is not None and set(start.terms) != set(base.terms):
        known = fitter.fit(start.terms, start.values)
    null = Null.of(problem.noise, fitter.rows.time, fitter.rows.used)
    found = search(fitter, known, null, None, progress)
    return Side(
        recording,
        fitter.motion,
        fitter,
        base,
        found,
        noise_levels(recording),
        following_response(recording),
    )


def aligned(simulated: Motion, recorded: Motion) -> tuple[Motion, Motion] | None:
    """Return both motions on the recorded one's clock, cropped to what they share.

    The result is None where they are not the same movement.
    """
    time = simulated.time
    grid = np.arange(0.0, time[-1], 1.0 / recorded.rate)
    moved = _with_channels(simulated, recorded.rate, lambda channel: np.interp(grid, time, channel))
    strength = correlate(recorded.velocity, moved.velocity, method="fft")
    shift = int(np.argmax(strength)) - (len(grid) - 1)
    begin, end = max(shift, 0), min(len(recorded.position), len(grid) + shift)
    if (end - begin) / recorded.rate < SHORTEST_S:
        return None
    pair = _cropped(moved, begin - shift, end - shift), _cropped(recorded, begin, end)
    apart = np.var(pair[1].position - pair[0].position) / np.var(pair[1].position)
    return pair if apart < LARGEST_MOVEMENT_DIFFERENCE else None


def _with_channels(motion: Motion, rate: float, read: Callable[[np.ndarray], np.ndarray]) -> Motion:
    """Return a motion whose channels are read anew, at another rate [Hz]."""
    return Motion(
        rate,
        read(motion.position),
        read(motion.velocity),
        read(motion.acceleration),
        read(motion.torque),
        read(motion.activation),
        cocontraction=None if motion.cocontraction is None else read(motion.cocontraction),
    )


def _cropped(motion: Motion, begin: int, end: int) -> Motion:
    return _with_channels(motion, motion.rate, lambda channel: channel[begin:end])


def _subtracted(simulated: Motion, recorded: Motion, second: Side) -> tuple[Fitter, np.ndarray]:
    """Return a fitter over what both bags share, whitened as the recorded bag, and the spectrum of
    the torque difference.
    """
    rows = Rows(len(recorded.position), recorded.rate)
    # The residual's spectrum is that of the whole bag; which seconds of it are taken does not
    # matter.
    rows.whiten_by(second.found.final.plain[: rows.count])
    fitter = Fitter(Columns(recorded, rows))
    return fitter, fitter.columns.target - rows.spectrum(simulated.torque)


def _described(first: Side, fitter: Fitter) -> np.ndarray:
    """Return the spectrum of the torque that the simulated bag's description gives on another
    movement.
    """
    final = first.found.final
    total = fitter.columns.torque(final.values)
    bank = GenericBank(first.fitter.columns)
    left = remainder(
        bank, first.fitter, final.residual, final.plain, interleaved(first.fitter.rows)
    )
    if left.worst > 0.0 and left.torque_share > MATERIAL_SHARE:
        total = total + GenericBank(fitter.columns, like=bank).prediction(bank.learn(final.plain))
    return total


def _extrapolation(first: Side, second: Side) -> list[str]:
    """Return a note for each quantity in which the recorded movement goes beyond what the
    description was learnt from.
    """
    notes = []
    for name, unit in (("position", "rad"), ("velocity", "rad/s")):
        reach = [
            float(np.ptp(np.percentile(getattr(s.motion, name), [0.5, 99.5])))
            for s in (first, second)
        ]
        if reach[1] > _EXTRAPOLATION_RATIO * reach[0]:
            notes.append(
                f"the recorded {name} spans {reach[1]:.3g} {unit}, the simulated {reach[0]:.3g} "
                f"{unit}: the description is extrapolated"
            )
    return notes


def _contributions(simulated: Fit, second: Side) -> list[Contribution]:
    """Return every term that either bag holds, the largest first."""
    recorded, fitter = second.found.final, second.fitter
    used = fitter.rows.used
    size = float(np.std(fitter.plain_target[used]))
    # What the fixation filters by is in every model, so the base terms are swapped and never
    # removed.
    own = fitter.evaluate(recorded.values).plain[used]
    found = []
    for name in dict.fromkeys([*recorded.terms, *simulated.terms]):
        swapped = {n: v for n, v in recorded.values.items() if n != name}
        if name in simulated.values:
            swapped[name] = simulated.values[name]
        torque = float(np.std(fitter.evaluate(swapped).plain[used] - own))
        only = (
            ""
            if name in simulated.values and name in recorded.values
            else "recorded"
            if name in recorded.values
            else "simulated"
        )
        found.append(
            Contribution(
                name,
                term_library()[name].place.value,
                torque,
                torque / size,
                _parameters(name, simulated, recorded),
                only,
            )
        )
    return sorted(found, key=lambda c: -c.torque)


def _parameters(name: str, simulated: Fit, recorded: Fit) -> dict[str, tuple[float, float, float]]:
    table = {}
    for p in term_library()[name].parameters:
        if p.fitted:
            a, b = (f.values.get(name, {}).get(p.symbol, np.nan) for f in (simulated, recorded))
            spread = math.hypot(
                *(f.errors.get(name, {}).get(p.symbol, np.nan) for f in (simulated, recorded))
            )
            table[p.key] = (a, b, (b - a) / spread if spread > 0 else np.nan)
    return table


def _actuator_differences(
    simulated: FollowingResponse | None, recorded: FollowingResponse | None
) -> list[str]:
    """Return one sentence for each way in which position follows the reference differently."""
    if simulated is None or recorded is None:
        return []
    differences = []
    a, b = simulated.bandwidth, recorded.bandwidth
    if a is not None and b is not None and max(a / b, b / a) > LEAST_BANDWIDTH_RATIO:
        differences.append(
            f"The recorded actuator follows up to {b:.1f} Hz, the simulated one up to {a:.1f} Hz."
        )
    ratio = recorded.slow_gain / simulated.slow_gain
    if max(ratio, 1.0 / ratio) > LEAST_GAIN_RATIO:
        differences.append(
            f"Held positions are {recorded.slow_gain:.3f} times the commanded ones, "
            f"{simulated.slow_gain:.3f} in the simulation."
        )
    if abs(recorded.delay - simulated.delay) > LEAST_DELAY_S:
        differences.append(
            f"Position follows the reference after {1000 * recorded.delay:.1f} ms, after "
            f"{1000 * simulated.delay:.1f} ms in the simulation."
        )
    return differences


def _conclude(result: Comparison, second: Side) -> None:
    """Set verdict, place and, where no term makes the difference, the missing block."""
    significant = [c for c in result.contributions if c.significant]
    final = second.found.final
    left = remainder(
        GenericBank(second.fitter.columns),
        second.fitter,
        final.residual,
        final.plain,
        interleaved(second.fitter.rows),
    )
    if left.worst > 0.0 and left.torque_share > MATERIAL_SHARE:
        assert result.where is not None
        result.block = missing_block(second.fitter, final, result.where.onsets)
        result.reasons.append(
            f"generic regressors predict {100 * left.share:.0f} % of what the best model "
            "leaves of the recorded torque"
        )
    if significant:
        result.place = significant[0].place
    elif result.block is not None:
        result.place = result.block.place
    elif result.actuator:
        result.place = "actuator and reference"
    result.verdict = "differ" if result.place else "agree"
