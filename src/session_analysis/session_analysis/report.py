"""The report of a validation: one HTML file with its pictures inside, which needs no network."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ankle_interfaces.value_text import with_error
from impedance_estimator.simultaneous.doubt import DOUBT_THRESHOLD
from session_analysis.correlation import CONFIDENCE, LEAST_PAIRS, RESAMPLES
from session_analysis.estimate_origin import NOT_STATED, SessionOrigin
from session_analysis.figures import figure4, figure5, figure8, frequency_figure
from session_analysis.hold_measures import LEAST_RESPONSES, LEAST_VALID, HoldMeasures
from session_analysis.hold_opinions import HoldOpinion
from session_analysis.holds import SHORTEST_HOLD
from session_analysis.html_page import bullets, heading, image, page, paragraph, table
from session_analysis.table3 import PAPER, as_text
from session_analysis.validation import Validation, write_holds, write_table

_QUESTION = (
    "K, the intrinsic stiffness, and G, the reflex gain, were estimated from torque and motion of "
    "the ankle alone. Electrodes tell in "
    "another way what the muscles did: background is their rectified EMG in the 40 ms before a "
    "movement, reflex the area above it from "
    "40 to 60 ms after a movement that stretches the muscle. The estimates are right to the "
    "extent that K goes with the background "
    "and G with the reflex, from one 60 s hold to the next; r = 1 is a perfect line."
)
_TOO_FEW_HOLDS = f"Too few holds for a correlation, which needs {LEAST_PAIRS} of one torque target."
_SIGN = (
    "Torque is what holds the ankle in place: a push of 5 N·m towards plantarflexion, the "
    "target of -5 N·m, is measured as +5 N·m."
)
_CAPTIONS = {
    "figure5": "Each dot is one hold of the soleus. Left as measured, each subject with a slope "
    "and an intercept of their own; right with "
    "those taken away, as in the table.",
    "figure4": "Rectified EMG averaged over all movements of a hold that stretch the muscle, for "
    "two successive holds that differ most.",
    "figure8": "The same two holds, grey, low-pass filtered at 0.1 Hz. Estimates follow a change "
    "within half a minute, EMG at once. " + _SIGN,
}
_ARBITER = (
    "K and G of each complete hold by the parallel cascade, which sees the whole hold at once and"
    " has no parametric form, beside the means of the online estimates. Its errors are from the "
    "scatter of stretches of 6 to 10 s; online errors are the means of those that the estimator "
    "states. The halves of a hold are fitted apart: where they differ by more than their errors, "
    "the subject changed. The last column says how much of the variance of each half's torque the"
    " fit of the other half predicts."
)
_FREQUENCY = (
    "Gain and phase from position to torque in each hold, measured (grey) and of the fitted "
    "cascade (colour), and the coherence of position and torque. Where the coherence is low, "
    "torque that no movement causes hides the joint; where the two lines part although it is "
    "high, the joint does what no linear pathway with one reflex does."
)
_RULES = (
    f"A hold is used when it lasted {SHORTEST_HOLD:g} s or more and {100 * LEAST_VALID:g} % of its "
    "estimates are valid; a muscle in it when "
    f"{LEAST_RESPONSES} or more of its responses could be measured. Values are z-scored within "
    "subject and torque target; "
    f"r is Pearson's, the interval a {100 * CONFIDENCE:g} % bias-corrected accelerated bootstrap "
    f"over pairs with {RESAMPLES} resamples. "
    f"A dash stands where fewer than {LEAST_PAIRS} holds are left: they tell no correlation."
)
_SESSIONS = (
    "What made K and G of each recording: the estimator, the subject's calibrated model and the "
    "calibrated rig. The plate moves later than its command; windows of the EMG start when it "
    "moves."
)


def write_report(validation: Validation, folder: Path, title: str) -> Path:
    """Write ``report.html``, the pictures, ``table3.csv`` and ``holds.csv``.

    The folder exists already; the path of the report is returned.
    """
    pictures = []
    correlated = any(cell.correlation.n >= LEAST_PAIRS for cell in validation.cells)
    if correlated:
        pictures.append(("Every hold (the paper's figure 5)", folder / "figure5.png"))
        figure5(validation.cells, pictures[0][1])
    if validation.excerpt is not None:
        pictures += [
            ("EMG about the movement (figure 4)", folder / "figure4.png"),
            ("Through two holds (figure 8)", folder / "figure8.png"),
        ]
        figure4(validation.excerpt, pictures[-2][1])
        figure8(validation.excerpt, pictures[-1][1])
    write_table(validation, folder / "table3.csv")
    write_holds(validation, folder / "holds.csv")
    subjects = sorted({one.subject for one in validation.measures})
    parts = [
        paragraph(
            f"Holds: {len(validation.measures)}. Subjects: {', '.join(subjects)}. Paper: "
            "van 't Veld et al., BIOROB 2018."
        ),
        paragraph(
            doubt_sentence(validation.measures),
            "loss" if any(one.doubtful > 0.0 for one in validation.measures) else "",
        ),
        paragraph(_QUESTION),
        heading("Correlation of impedance with EMG (the paper's table III)"),
        table(correlation_rows(validation)) if correlated else paragraph(_TOO_FEW_HOLDS),
        paragraph(_RULES),
    ]
    if validation.sessions:
        parts += [heading("Estimator and calibration"), paragraph(_SESSIONS)]
        parts += [bullets(validation.origin_notes, "loss")] if validation.origin_notes else []
        parts += [table(session_rows(validation.sessions))]
    for caption, picture in pictures:
        parts += [heading(caption), image(picture), paragraph(_CAPTIONS[picture.stem])]
    parts += [heading("Holds"), table(_hold_rows(validation))]
    parts += _offline_parts(validation.opinions, folder / "frequency_response.png")
    left_out = [f"{one.what}: {one.reason}" for one in validation.excluded]
    parts += [heading("Left out"), bullets(left_out)]
    parts += [heading("Remarks on the recordings"), bullets(validation.notes)]
    path = folder / "report.html"
    path.write_text(page(title, parts, interactive=False), encoding="utf-8")
    return path


def correlation_rows(validation: Validation) -> list[list[str]]:
    """Return Table III beside the paper's, as text; the first row names the columns."""
    rows = [
        ["pathway", "target", "muscle", "N", "r [95 % interval]", "paper: N", "r [95 % interval]"]
    ]
    for cell in validation.cells:
        # A session may name the same plantarflexion target with the other sign.
        paper = PAPER.get((cell.pathway, -abs(cell.target) if cell.target else 0.0, cell.muscle))
        theirs = [str(paper.n), as_text(paper)] if paper else ["", ""]
        rows.append(
            [
                cell.pathway,
                f"{cell.target:g} N·m",
                cell.muscle,
                str(cell.correlation.n),
                as_text(cell.correlation),
                *theirs,
            ]
        )
    return rows


def doubt_sentence(measures: Sequence[HoldMeasures]) -> str:
    """Return how many of the estimates behind the holds are doubtful, in one sentence.

    Parameters
    ----------
    measures
        Of the holds that are used.
    """
    known = [one.doubtful for one in measures if math.isfinite(one.doubtful)]
    if not known:
        return "No estimate states a doubt: this estimator does not judge itself."
    some = sum(share > 0.0 for share in known)
    unknown = len(measures) - len(known)
    return (
        f"Doubtful estimates, with a doubt of {DOUBT_THRESHOLD:g} and more: in {some} of "
        f"{len(known)} holds; on average {100 * float(np.mean(known)):.0f} % of a hold's "
        f"estimates, at most {100 * max(known):.0f} %."
        + (f" The estimates of {unknown} holds state no doubt." if unknown else "")
    )


def session_rows(sessions: Sequence[SessionOrigin]) -> list[list[str]]:
    """Return what made the numbers of each session, as text; the first row names the columns.

    Parameters
    ----------
    sessions
        In the order of the bags.
    """
    head = ["subject", "recording", "estimates", "estimator", "model", "rig", "lag of plate [ms]"]
    rows = [head]
    for one in sessions:
        origin = one.origin
        made = [origin.algorithm, origin.shown("model"), origin.shown("rig")] if origin else []
        rows.append(
            [
                one.subject,
                one.path.name,
                "made anew" if one.made_anew else "recorded",
                *(made or [NOT_STATED] * 3),
                f"{1e3 * one.lag:.1f}" if math.isfinite(one.lag) else NOT_STATED,
            ]
        )
    return rows


def _hold_rows(validation: Validation) -> list[list[str]]:
    rows = [
        [
            "subject",
            "hold",
            "target [N·m]",
            "K [N·m/rad]",
            "G [N·m·s/rad]",
            "background SOL, TA, GL, GM [µV]",
            "reflex SOL, TA, GL, GM [µV·s]",
            "responses",
            "doubtful [%]",
        ]
    ]
    for one in validation.measures:
        background = ", ".join(f"{v:.1f}" for v in 1e6 * one.background)
        reflex = ", ".join(f"{v:.3f}" for v in 1e6 * one.reflex)
        counts = f"{np.min(one.responses)} to {np.max(one.responses)}"
        rows.append(
            [
                one.subject,
                str(one.hold.number),
                f"{one.hold.target:g}",
                f"{one.K:.1f}",
                f"{one.G:.2f}",
                background,
                reflex,
                counts,
                f"{100 * one.doubtful:.0f}" if math.isfinite(one.doubtful) else NOT_STATED,
            ]
        )
    return rows


def _offline_parts(opinions: list[HoldOpinion], picture: Path) -> list[str]:
    """Return the holds by both methods, and their frequency responses as a picture."""
    if not opinions:
        return []
    parts = [
        heading("Holds by an offline method"),
        paragraph(_ARBITER),
        table(opinion_rows(opinions)),
    ]
    judged = [one for one in opinions if one.opinion is not None]
    if judged:
        frequency_figure(judged, picture)
        parts += [heading("From position to torque"), image(picture), paragraph(_FREQUENCY)]
    return parts


def opinion_rows(opinions: list[HoldOpinion]) -> list[list[str]]:
    """Return online and offline values of each hold as text; the first row names the columns."""
    head = ["subject", "hold", "target [N·m]", "K online [N·m/rad]", "K offline", "K, its halves"]
    head += ["G online [N·m·s/rad]", "G offline", "G, its halves", "VAF of the other half [%]"]
    rows = [head]
    for one in opinions:
        own = [one.subject, str(one.hold.number), f"{one.hold.target:g}"]
        found = one.opinion
        if found is None:
            rows.append([*own, with_error(one.K), one.reason, "", with_error(one.G), "", "", ""])
            continue
        rows.append(
            [
                *own,
                with_error(one.K),
                with_error(found.K),
                " | ".join(map(with_error, found.halves_K)),
                with_error(one.G),
                with_error(found.G),
                " | ".join(map(with_error, found.halves_G)),
                " | ".join(f"{vaf:.1f}" for vaf in found.held_out_vaf),
            ]
        )
    return rows
