"""K and G of a model that lacks physics, fitted to the whitened and to the plain torque.

``python -m simulation_study.weighting --seed 1 --effects 30 --pairs 10 --out FOLDER``

Every recording of the independent rig hides one effect or two, and the base model, which lacks
them, is fitted to it in both ways. FOLDER receives ``weighting.md``: how far K and G are off by
either fit, for recordings in which little and in which much of the residual is predictable. The
diagnosis states the values of the one or the other by this share (`stated_fit`).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from blind_rig.impedance import TrueImpedance
from model_discrepancy.criticism.remainder import remainder
from model_discrepancy.criticism.stated_fit import LEAST_SHARE, plain_fit, stated_fit
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.movements import find_onsets
from model_discrepancy.problem import prepare
from model_discrepancy.recording.reading import check, open_recording
from model_discrepancy.report.operating_point import operating_point, stated_impedance
from simulation_study.counted_table import write_table
from simulation_study.verdict_cases import Plan, made
from simulation_study.verdict_report import rate_with_interval

GAINS = ("K", "G")
KEYS = {"K": "K[N.m/rad]", "G": "G[N.m.s/rad]"}


class Compared(NamedTuple):
    """Holds one recording.

    Attributes
    ----------
    case
        Its name.
    share
        Of the whitened residual of the base model that is predictable on unseen rows.
    plain_stated
        Whether the diagnosis would state the values of the plain fit.
    whitened, plain
        Errors of K and G by either fit [%], by the names in `GAINS`.
    """

    case: str
    share: float
    plain_stated: bool
    whitened: dict[str, float]
    plain: dict[str, float]


def compare(plan: Plan) -> Compared | None:
    """Return a case fitted in both ways; None where the recording has no true K and G or is bad.

    Parameters
    ----------
    plan
        The case.
    """
    recording, truth, _ = made(plan, None)
    reading = check(open_recording(recording))
    if truth is None or reading.faults:
        return None
    problem = prepare(reading.trusted)
    fitter, base = problem.fitter, problem.base
    after = remainder(problem.bank, fitter, base.residual, base.plain, problem.parts)
    return Compared(
        plan.name,
        after.share,
        stated_fit(fitter, base, after) is not base,
        _errors(fitter, base, truth),
        _errors(fitter, plain_fit(fitter, base), truth),
    )


def _errors(fitter: Fitter, fit: Fit, truth: TrueImpedance) -> dict[str, float]:
    """Return the errors of K and G of a fit [%]."""
    at = operating_point(fitter.motion, find_onsets(fitter.columns))
    stated = stated_impedance(fit, at)
    return {
        name: 100.0 * (stated[KEYS[name]][0] / float(getattr(truth, name)) - 1.0) for name in GAINS
    }


def report(found: list[Compared], command: str) -> str:
    """Return the study in Markdown.

    Parameters
    ----------
    found
        Every recording.
    command
        By which it was made.
    """
    lines = [
        "# Values of a model that lacks physics",
        "",
        f"Written by `{command}`: {len(found)} recordings of the independent rig that hide one "
        "effect or two, fitted by the base model, which has none of them.",
        "",
        "| of the residual, predictable | recordings | median error of K, whitened; plain | of G, "
        "whitened; plain | K nearer by the plain fit | G nearer by the plain fit |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for words, stated in (
        ("little: the whitened fit is stated", False),
        ("much: the plain fit is stated", True),
    ):
        rows = [one for one in found if one.plain_stated is stated]
        lines.append(f"| {words} | {len(rows)} | " + " | ".join(_summary(rows)) + " |")
    lines += [
        "",
        f"Much is at least {100 * LEAST_SHARE:g} % of the whitened residual, and torque that "
        "matters.",
        "",
        "| recording | predictable [%] | K, whitened; plain [%] | G, whitened; plain [%] | stated "
        "|",
        "| --- | --- | --- | --- | --- |",
    ]
    for one in sorted(found, key=lambda one: one.share):
        errors = " | ".join(f"{one.whitened[n]:+.1f}; {one.plain[n]:+.1f}" for n in GAINS)
        word = "plain" if one.plain_stated else "whitened"
        lines.append(f"| {one.case} | {100 * max(one.share, 0.0):.1f} | {errors} | {word} |")
    return "\n".join(lines) + "\n"


def _summary(rows: list[Compared]) -> Iterator[str]:
    """Yield the cells of a row of the summary."""
    for name in GAINS:
        sizes = [np.abs([getattr(one, fit)[name] for one in rows]) for fit in ("whitened", "plain")]
        yield "; ".join(f"{np.median(s):.1f} %" if len(s) else "none" for s in sizes)
    for name in GAINS:
        nearer = [abs(one.plain[name]) < abs(one.whitened[name]) for one in rows]
        yield rate_with_interval(sum(nearer), len(nearer))


def main() -> None:
    """Run the study and write its table."""
    write_table(
        "weighting",
        (__doc__ or "").splitlines()[0],
        {"effect": 30, "pair": 10},
        lambda plan: [found for found in [compare(plan)] if found is not None],
        report,
    )


if __name__ == "__main__":
    main()
