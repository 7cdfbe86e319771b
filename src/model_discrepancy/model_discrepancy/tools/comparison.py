"""The difference between a simulated and a recorded bag: how large, where, and what makes it.

Where both made the same movement, the torques are subtracted. Otherwise a description learnt from
the simulated bag (its best model, and the generic bank for what that leaves) is driven by the
recorded movement, and its torque is subtracted from the recorded one. What makes the difference is
told from the model fitted to each bag: of every term the torque that changes on the recorded
movement when the simulated bag's values of that term are put in.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import correlate

from ankle_physics.term import term_library
from model_discrepancy.criticism.locate import ResidualMap, residual_map
from model_discrepancy.criticism.missing_block import MissingBlock, missing_block
from model_discrepancy.criticism.remainder import remainder
from model_discrepancy.fit.columns import Columns
from model_discrepancy.fit.fitter import MATERIAL_SHARE, Fit, Fitter
from model_discrepancy.fit.generic_bank import GenericBank
from model_discrepancy.fit.halves import interleaved
from model_discrepancy.fit.held_out import vaf
from model_discrepancy.fit.rows import Rows
from model_discrepancy.problem import prepare
from model_discrepancy.recording.channel_quality import (
    FollowingResponse,
    following_response,
    noise_levels,
)
from model_discrepancy.recording.motion import Motion
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.recording_checks import SHORTEST_S, faults
from model_discrepancy.search.found import Found
from model_discrepancy.search.null import Null
from model_discrepancy.search.term_search import search

# Movements that differ by less than this share of their variance are the same: below it position
# noise of 20 dB would hide a difference.
LARGEST_MOVEMENT_DIFFERENCE = 0.01
# A term's difference is significant when it changes the torque by this share of its deviation or
# more ...
LEAST_TORQUE = 0.03
# ... and a parameter of it by this many standard errors.
LEAST_ERRORS = 4.0
# Significant differences of the actuator: of bandwidth and gain as a ratio, of delay [s].
LEAST_BANDWIDTH_RATIO = 1.1
LEAST_GAIN_RATIO = 1.03
LEAST_DELAY_S = 0.002
# Movements larger than those that the description was learnt from are extrapolated.
_EXTRAPOLATION_RATIO = 1.2


@dataclass
class Side:
    """Holds one of the two bags and the model fitted to it.

    Attributes
    ----------
    base
        The paper's model fitted, with standard errors.
    found
        Terms that were found in addition.
    noise
        Standard deviation of each channel's noise.
    following
        Reference-to-position response, where there is a reference.
    """

    recording: Recording
    motion: Motion
    fitter: Fitter
    base: Fit
    found: Found
    noise: dict[str, float]
    following: FollowingResponse | None


@dataclass(frozen=True)
class Contribution:
    """Describes what one term adds to the difference.

    Attributes
    ----------
    name, place
        Of the term.
    torque
        Rms that changes when the simulated values are put in [N.m].
    share
        The same per standard deviation of the recorded torque.
    parameters
        Simulated value, recorded value, difference in standard errors, by symbol with unit; NaN
        where a side lacks the term.
    only
        ``recorded`` or ``simulated`` where the other side lacks the term, else empty.
    """

    name: str
    place: str
    torque: float
    share: float
    parameters: dict[str, tuple[float, float, float]]
    only: str = ""

    @property
    def significant(self) -> bool:
        """Tell whether it is large and sure enough."""
        sure = bool(self.only) or any(
            abs(z) >= LEAST_ERRORS for _, _, z in self.parameters.values() if np.isfinite(z)
        )
        return self.share >= LEAST_TORQUE and sure


@dataclass
class Comparison:
    """Holds everything that was found out about two bags; a bad recording has `reasons` only."""

    names: tuple[str, str]
    verdict: str
    reasons: list[str] = field(default_factory=list)
    sides: tuple[Side, Side] | None = None
    method: str = ""
    difference: np.ndarray = field(default_factory=lambda: np.zeros(0))
    rms: float = 0.0
    vaf: float = 100.0
    where: ResidualMap | None = None
    contributions: list[Contribution] = field(default_factory=list)
    actuator: list[str] = field(default_factory=list)
    block: MissingBlock | None = None
    place: str = ""

    @property
    def headline(self) -> str:
        """Return the result in one or two sentences."""
        if self.verdict == "bad_recording":
            return f"These bags cannot be compared: {self.reasons[0]}."
        actuator = f" {self.actuator[0]}" if self.actuator else ""
        size = (
            f"The recorded torque differs from the simulated one by {self.rms:.2f} N.m rms "
            f"(the simulation explains {self.vaf:.1f} % of it)"
        )
        significant = [c for c in self.contributions if c.significant]
        if significant:
            others = ", ".join(c.name.replace("_", " ") for c in significant[1:4])
            return (
                f"{size}, most of all in "
                f"{_in_words(significant[0])}."
                f"{' Also: ' + others + '.' if others else ''}{actuator}"
            )
        if self.block is not None:
            return f"{size}; no known term makes it. {self.block.sentence}{actuator}"
        if self.actuator:
            return (
                f"The joints agree (the simulation explains {self.vaf:.1f} % of the recorded "
                f"torque), the actuators do not.{actuator}"
            )
        return (
            f"The bags agree: the simulation explains {self.vaf:.1f} % of the recorded torque, "
            "and what is left follows no movement."
        )

    def content(self) -> dict[str, Any]:
        """Return plain data for ``compare.json``."""
        plain: dict[str, Any] = {
            "verdict": self.verdict,
            "headline": self.headline,
            "bags": list(self.names),
            "reasons": self.reasons,
        }
        if self.sides is None or self.where is None:
            return plain
        plain["method"] = self.method
        plain["difference"] = {
            "rms[N.m]": self.rms,
            "vaf[%]": self.vaf,
            **self.where.summary(self.place),
        }
        plain["contributions"] = [
            {
                "name": c.name,
                "location": c.place,
                "torque[N.m]": c.torque,
                "share_of_torque": c.share,
                "only": c.only or None,
                "told": c.significant,
                "parameters": {
                    key: [_number(v) for v in values] for key, values in c.parameters.items()
                },
            }
            for c in self.contributions
        ]
        plain["base_parameters"] = {
            key: [list(map(_number, pair)) for pair in pairs]
            for key, pairs in base_parameters(self.sides).items()
        }
        plain["actuator"] = {
            "differences": self.actuator,
            **{
                word: None
                if s.following is None
                else {
                    "slow_gain": s.following.slow_gain,
                    "bandwidth[Hz]": s.following.bandwidth,
                    "delay[s]": s.following.delay,
                }
                for word, s in zip(("simulated", "recorded"), self.sides, strict=True)
            },
        }
        plain["noise"] = {
            word: s.noise for word, s in zip(("simulated", "recorded"), self.sides, strict=True)
        }
        plain["rate[Hz]"] = [s.recording.rate for s in self.sides]
        plain["duration[s]"] = [s.recording.duration for s in self.sides]
        plain["missing_block"] = self.block.content() if self.block is not None else None
        return plain

    def save(self, path: Path) -> None:
        """Write ``compare.json``."""
        path.write_text(json.dumps(self.content(), indent=1, allow_nan=False, default=float) + "\n")


def compare(
    simulated: Recording, recorded: Recording, progress: Callable[[str], None] = lambda _: None
) -> Comparison:
    """Localise the difference between two recordings.

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
    """Fit one bag: the paper's model, then whatever else it holds, beginning with the terms of
    `start`.
    """
    problem = prepare(recording, progress=progress)
    fitter = problem.fitter
    base = fitter.with_errors(problem.base)
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
    read = [np.interp(grid, time, channel) for channel in _channels(simulated)]
    moved = Motion(recorded.rate, read[0], read[1], read[2], read[3], read[4])
    strength = correlate(recorded.velocity, moved.velocity, method="fft")
    shift = int(np.argmax(strength)) - (len(grid) - 1)
    begin, end = max(shift, 0), min(len(recorded.position), len(grid) + shift)
    if (end - begin) / recorded.rate < SHORTEST_S:
        return None
    pair = _cropped(moved, begin - shift, end - shift), _cropped(recorded, begin, end)
    apart = np.var(pair[1].position - pair[0].position) / np.var(pair[1].position)
    return pair if apart < LARGEST_MOVEMENT_DIFFERENCE else None


def _channels(motion: Motion) -> tuple[np.ndarray, ...]:
    return (motion.position, motion.velocity, motion.acceleration, motion.torque, motion.activation)


def _cropped(motion: Motion, begin: int, end: int) -> Motion:
    part = [channel[begin:end] for channel in _channels(motion)]
    return Motion(motion.rate, part[0], part[1], part[2], part[3], part[4])


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
    spectra = fitter.columns.spectra(final.values)
    total = sum(
        (final.values[n][s] * spectrum for (n, s), spectrum in spectra.items()),
        np.zeros_like(fitter.columns.target),
    )
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


def base_parameters(sides: tuple[Side, Side]) -> dict[str, list[tuple[float, float]]]:
    """Return the value and standard error of each parameter of the paper's model alone, simulated
    and recorded, by symbol with unit.
    """
    table = {}
    for name in sides[0].base.terms:
        for p in term_library()[name].parameters:
            if p.fitted:
                table[p.key] = [
                    (s.base.values[name][p.symbol], s.base.errors[name].get(p.symbol, np.nan))
                    for s in sides
                ]
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
    """Verdict, place and, where no term makes the difference, the missing block."""
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


def _in_words(c: Contribution) -> str:
    """Return a contribution with the parameter that differs most."""
    name = f"{c.name.replace('_', ' ')} ({c.place}; {c.torque:.2f} N.m rms)"
    if c.only:
        return f"{name}, which only the {c.only} one has"
    key, (a, b, _) = max(c.parameters.items(), key=lambda item: abs(np.nan_to_num(item[1][2])))
    symbol, unit = key.rstrip("]").split("[")
    return f"{name}: {symbol} is {b:.4g} {'' if unit == '1' else unit} instead of {a:.4g}"


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
