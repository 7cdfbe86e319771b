"""A course in one picture: the reflex of each session, the baseline, the trend, the successes."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from biofeedback.session.course import CONDITIONED, Course
from biofeedback.session.course_record import CourseRecord
from biofeedback.session.course_trend import comparisons, trend

BLUE, ORANGE, GREY = "#0072b2", "#d55e00", "#777777"
"""Okabe and Ito's colours; control and conditioned trials differ in their marks, too."""
DETECTABLE_CHANGE_RATIO = 1.96 * math.sqrt(2.0)
"""Minimal detectable change over the standard error of measurement: the difference of two sessions
of an unchanged reflex stays below it 19 times of 20."""
MUSCLE_NAMES = {
    "SOL": "soleus",
    "TA": "tibialis anterior",
    "GL": "lateral gastrocnemius",
    "GM": "medial gastrocnemius",
}
MEASURE_NAMES = {"reflex_emg": "EMG reflex", "G": "reflex gain"}


def draw_course(record: CourseRecord, course: Course, path: Path) -> None:
    """Write the picture of a course, finished or not, as PNG or PDF by the path's ending.

    Parameters
    ----------
    record
        Record of the sessions so far.
    course
        The plan of the course.
    path
        File to write the picture to.
    """
    course_figure(record, course).savefig(path, dpi=130)


def course_figure(record: CourseRecord, course: Course) -> Figure:
    """Draw the reflex of each session beside the baseline, and the successes below.

    Parameters
    ----------
    record
        Record of the sessions so far.
    course
        The plan of the course.
    """
    results = record.results
    number = np.array([result.number for result in results])
    baseline = np.array([r.control for r in results if r.number <= course.baseline_sessions])
    baseline = baseline[np.isfinite(baseline)]
    unit = 100.0 / float(np.mean(baseline)) if len(baseline) else math.nan
    figure = Figure(figsize=(8.0, 7.0), layout="constrained")
    sizes, rates = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    if len(baseline) > 1:
        spread = unit * float(np.std(baseline, ddof=1))
        sizes.axhspan(
            100.0 - spread, 100.0 + spread, color=GREY, alpha=0.2, label="baseline ± 1 SD"
        )
        for sign, label in ((-1, "minimal detectable change of one session"), (1, None)):
            edge = 100.0 + sign * DETECTABLE_CHANGE_RATIO * spread
            sizes.axhline(edge, color=GREY, ls=":", lw=1.2, label=label)
    sizes.plot(
        number,
        [unit * r.control for r in results],
        "o",
        color=BLUE,
        mfc="none",
        label="control trials",
    )
    sizes.plot(
        number,
        [unit * r.conditioned for r in results],
        "s",
        color=ORANGE,
        label="conditioned trials",
    )
    found = trend(record, course, CONDITIONED)
    if found is not None:
        first, last = found.compared
        span = [first - 0.5, last + 0.5]
        label = f"{found.level:.3g} % interval of sessions {first} to {last}"
        sizes.fill_between(span, found.lower, found.upper, color=ORANGE, alpha=0.25, label=label)
    sizes.set_title(sentence(record, course).replace(": ", ":\n", 1), fontsize=10)
    sizes.axvline(course.baseline_sessions + 0.5, color=GREY, lw=0.8)
    name = f"{MUSCLE_NAMES[course.muscle]}: {MEASURE_NAMES[course.measure]}"
    sizes.set_ylabel(f"{name} [% of baseline]")
    rates.plot(number, [100.0 * r.success_rate for r in results], "s", color=ORANGE)
    rates.axhline(100.0 * course.success_rate, color=GREY, ls="--", lw=0.8)
    rates.set_ylabel("successes [%]")
    rates.set_ylim(0, 100)
    rates.set_xlabel("session")
    rates.set_xlim(0.5, course.sessions + 0.5)
    figure.suptitle(f"{record.subject}: {course.title}", wrap=True)
    figure.legend(loc="outside lower center", ncols=2, frameon=False, fontsize=9)
    return figure


def sentence(record: CourseRecord, course: Course) -> str:
    """Say what a course has come to, in words that need no statistics."""
    found = trend(record, course, CONDITIONED)
    measure = MEASURE_NAMES[course.measure]
    if found is None:
        done = len(record.results)
        following = next((end for end in comparisons(course) if end > done), None)
        reason = (
            "too few complete ones for a trend"
            if following is None
            else f"they are compared with the baseline after session {following}: no trend yet"
        )
        return f"{done} of {course.sessions} sessions are done, {reason} of the {measure}"
    first, last = found.compared
    interval = (
        f"{found.percent:.0f} % of the baseline ({found.level:.3g} % interval {found.lower:.0f} to "
        f"{found.upper:.0f} %, sessions {first} to {last} against 1 to {course.baseline_sessions})"
    )
    if found.found == "none":
        return f"no change is shown{'' if found.final else ' yet'}: {interval}"
    wanted = "as trained" if found.found == course.direction else "against the training"
    return f"the reflex has gone {found.found}, {wanted}: {interval}"
