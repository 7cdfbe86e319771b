"""The default estimator on the same recordings with all channels, without the command, and with
angle and torque alone.

``python -m simulation_study.file_without_command --seed 1 --nulls 40 --effects 52 --out FOLDER``

The command is an estimator's instrument against the closed loop of the rig, and a file often lacks
it. FOLDER receives ``file_without_command.md``: errors of K and G, and which recordings are
doubted.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from impedance_estimator.offline.recorded_estimates import estimate_signal
from impedance_estimator.simultaneous.doubt import DOUBT_THRESHOLD
from simulation_study.counted_table import write_table
from simulation_study.verdict_cases import Plan, made
from simulation_study.verdict_report import rate_with_interval

CHANNELS = {
    "angle, velocity, torque and command": (True, True),
    "angle, velocity and torque": (True, False),
    "angle and torque": (False, False),
}
"""Each set of channels is said in words, and by whether it has the velocity and the command."""
GAINS = {"K": "K[N.m/rad]", "G": "G[N.m.s/rad]"}
LARGE_ERRORS = {"K": 15.0, "G": 25.0}
"""[%] An estimate that is off by more has to be doubted."""


class Estimated(NamedTuple):
    """Holds the estimates from one set of channels of one recording.

    Attributes
    ----------
    case
        Its name.
    channels
        One of `CHANNELS`.
    errors
        Of the medians of K and G over the recording [%], by name.
    doubted
        Whether at least half of the estimates are doubtful.
    """

    case: str
    channels: str
    errors: dict[str, float]
    doubted: bool

    @property
    def off(self) -> bool:
        """Tell whether K or G is off by more than `LARGE_ERRORS`."""
        return any(abs(self.errors[name]) > most for name, most in LARGE_ERRORS.items())


def estimated(plan: Plan) -> list[Estimated]:
    """Return the estimates of one case from every set of channels; none where K and G have no true
    value.

    Parameters
    ----------
    plan
        The case.
    """
    recording, truth, _ = made(replace(plan, velocity=True, reference=True))
    if truth is None:
        return []
    time = np.arange(len(recording.position)) / recording.rate
    found = []
    for words, (velocity, command) in CHANNELS.items():
        median = estimate_signal(
            time,
            recording.position,
            recording.velocity if velocity else None,
            recording.torque,
            reference=recording.reference if command else None,
        ).median()
        errors = {
            name: 100.0 * (median[column] / float(getattr(truth, name)) - 1.0)
            for name, column in GAINS.items()
        }
        found.append(
            Estimated(plan.name, words, errors, bool(median["doubt[1]"] >= DOUBT_THRESHOLD))
        )
    return found


def report(found: list[Estimated], command: str) -> str:
    """Return the study in Markdown.

    Parameters
    ----------
    found
        From every set of channels of every recording.
    command
        By which it was made.
    """
    off = " or ".join(f"{name} off by more than {most:g} %" for name, most in LARGE_ERRORS.items())
    lines = [
        "# The default estimator on files without a command",
        "",
        f"Written by `{command}`: recordings of the independent rig, estimated three times each. "
        f"An error is large with {off}.",
        "",
        "| channels | median error of K, G without mismatch | with one effect | doubted without "
        "mismatch | doubted of small errors, with an effect | doubted of large errors |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for words in CHANNELS:
        rows = [one for one in found if one.channels == words]
        nulls = [one for one in rows if one.case.startswith("null")]
        effects = [one for one in rows if not one.case.startswith("null")]
        small, large = ([one for one in effects if one.off is off] for off in (False, True))
        large += [one for one in nulls if one.off]
        lines.append(
            f"| {words} | {_medians(nulls)} | {_medians(effects)} | "
            + " | ".join(
                rate_with_interval(sum(one.doubted for one in some), len(some))
                for some in ([one for one in nulls if not one.off], small, large)
            )
            + " |"
        )
    lines += [
        "",
        "| recording | " + " | ".join(f"K, G [%] from {words}" for words in CHANNELS) + " |",
        "| --- | " + " | ".join("---" for _ in CHANNELS) + " |",
    ]
    for case in dict.fromkeys(one.case for one in found):
        cells = [
            ", ".join(f"{one.errors[name]:+.1f}" for name in GAINS)
            + (" doubted" if one.doubted else "")
            for one in found
            if one.case == case
        ]
        lines.append(f"| {case} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _medians(rows: list[Estimated]) -> str:
    """Return the median sizes of the errors of K and G in words."""
    if not rows:
        return "none"
    sizes = {name: np.median([abs(one.errors[name]) for one in rows]) for name in GAINS}
    return ", ".join(f"{size:.1f} %" for size in sizes.values())


def main() -> None:
    """Run the study and write its table."""
    write_table(
        "file_without_command",
        (__doc__ or "").split("\n\n")[0],
        {"null": 40, "effect": 52},
        estimated,
        report,
    )


if __name__ == "__main__":
    main()
