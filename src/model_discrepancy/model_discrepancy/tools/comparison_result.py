"""The result of a comparison of two recordings, term by term and in words."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ankle_physics.joint_profile import joint_in_force
from ankle_physics.term import term_library
from model_discrepancy.criticism.locate import ResidualMap
from model_discrepancy.criticism.missing_block import MissingBlock
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.recording.channel_quality import FollowingResponse
from model_discrepancy.recording.motion import Motion
from model_discrepancy.recording.recording import Recording
from model_discrepancy.report.plain_words import vaf_text
from model_discrepancy.search.found import Found

# A term's difference is significant when it changes the torque by this share of its deviation or
# more ...
LEAST_TORQUE = 0.03
# ... and a parameter of it by this many standard errors.
LEAST_ERRORS = 4.0
SIGNIFICANT = (
    f"A term is significant where it changes the torque by {100 * LEAST_TORQUE:g} % or more of the "
    f"recorded torque, and one of its parameters lies {LEAST_ERRORS:g} standard errors or more "
    "apart, or one bag lacks the term. The standard errors are those of the noise, each bag's by "
    "the terms that were found in it: a bag without noise has next to none, so that many standard "
    "errors apart may be next to no torque. A parameter moves, too, where the other bag holds a "
    "term that this one lacks."
)
"""What a report says of the word."""


@dataclass
class Side:
    """Holds one of the two bags and the model fitted to it.

    Attributes
    ----------
    base
        The base model fitted, with standard errors.
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
        return self.verdict == "yes"

    @property
    def verdict(self) -> str:
        """Return whether it is significant in words, with the reason where it is not."""
        sure = bool(self.only) or any(
            abs(z) >= LEAST_ERRORS for _, _, z in self.parameters.values() if np.isfinite(z)
        )
        if self.share < LEAST_TORQUE:
            return f"no: below {100 * LEAST_TORQUE:g} % of the torque"
        return "yes" if sure else f"no: below {LEAST_ERRORS:g} standard errors"


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
        """Return the result in one or two sentences, in the units of the joint in force."""
        return joint_in_force().in_units(self._headline())

    def _headline(self) -> str:
        if self.verdict == "bad_recording":
            return f"These bags cannot be compared: {self.reasons[0]}."
        actuator = f" {self.actuator[0]}" if self.actuator else ""
        size = (
            f"The recorded torque differs from the simulated one by {self.rms:.2f} N.m rms "
            f"(the simulation explains {vaf_text(self.vaf)} % of it)"
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
                f"The joints agree (the simulation explains {vaf_text(self.vaf)} % of the recorded "
                f"torque), the actuators do not.{actuator}"
            )
        return (
            f"The bags agree: the simulation explains {vaf_text(self.vaf)} % of the recorded "
            "torque, and what is left follows no movement."
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
        plain["significant_means"] = SIGNIFICANT
        plain["contributions"] = [
            {
                "name": c.name,
                "location": c.place,
                "torque[N.m]": c.torque,
                "share_of_torque": c.share,
                "only": c.only or None,
                "significant": c.significant,
                "significant_in_words": c.verdict,
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
        text = json.dumps(self.content(), indent=1, allow_nan=False, default=float)
        path.write_text(joint_in_force().in_units(text) + "\n")


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


def base_parameters(sides: tuple[Side, Side]) -> dict[str, list[tuple[float, float]]]:
    """Return the value and standard error of each parameter of the base model alone, simulated and
    recorded, by symbol with unit.
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
