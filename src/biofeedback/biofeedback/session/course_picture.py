"""A course in one picture: the reflex of each session, the baseline, the trend, the successes."""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from biofeedback.session.course import CONDITIONED, MEASURES, Course
from biofeedback.session.course_record import FINAL_SESSIONS, CourseRecord, trend

BLUE, ORANGE, GREY = "#0072b2", "#d55e00", "#777777"
"""Okabe and Ito's colours; control and conditioned trials differ in their marks, too."""


def draw_course(record: CourseRecord, course: Course, path: Path) -> None:
    """Write the picture of a course, finished or not, as PNG or PDF by the path's ending.

    Parameters
    ----------
    record
        What was done.
    course
        Its plan.
    path
        Of the picture.
    """
    results = record.results
    number = np.array([result.number for result in results])
    baseline = [r.control for r in results if r.number <= course.baseline_sessions]
    unit = 100.0 / float(np.mean(baseline)) if baseline else math.nan
    figure, (sizes, rates) = plt.subplots(
        2, 1, figsize=(8.0, 6.0), sharex=True, height_ratios=(3, 1), layout="constrained"
    )
    if len(baseline) > 1:
        spread = unit * float(np.std(baseline, ddof=1))
        sizes.axhspan(
            100.0 - spread, 100.0 + spread, color=GREY, alpha=0.2, label="baseline ± 1 SD"
        )
    sizes.plot(
        number, [unit * r.control for r in results], "o", color=BLUE, mfc="none", label="control"
    )
    sizes.plot(
        number, [unit * r.conditioned for r in results], "s", color=ORANGE, label="conditioned"
    )
    found = trend(record, course, CONDITIONED)
    if found is not None:
        last = [number[-1] - min(FINAL_SESSIONS, found.sessions[0]) + 0.5, number[-1] + 0.5]
        sizes.fill_between(last, found.lower, found.upper, color=ORANGE, alpha=0.25)
        sizes.set_title(sentence(record, course), fontsize=10)
    sizes.axvline(course.baseline_sessions + 0.5, color=GREY, lw=0.8)
    sizes.set_ylabel(f"{course.muscle} {course.measure} [% of baseline]")
    sizes.legend(frameon=False, fontsize=9)
    rates.plot(number, [100.0 * r.success_rate for r in results], "s", color=ORANGE)
    rates.axhline(100.0 * course.success_rate, color=GREY, ls="--", lw=0.8)
    rates.set_ylabel("successes [%]")
    rates.set_ylim(0, 100)
    rates.set_xlabel(f"session of {record.subject} ({course.title})")
    rates.set_xlim(0.5, course.sessions + 0.5)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def sentence(record: CourseRecord, course: Course) -> str:
    """Say what a course has come to, in words that need no statistics."""
    found = trend(record, course, CONDITIONED)
    if found is None:
        return (
            f"{len(record.results)} of {course.sessions} sessions are done: too few for a trend "
            f"of the {course.measure} [{MEASURES[course.measure]}]"
        )
    interval = (
        f"{found.percent:.0f} % of the baseline (95 % interval {found.lower:.0f} to "
        f"{found.upper:.0f} %, last {found.sessions[0]} against {found.sessions[1]} sessions)"
    )
    if found.found == "none":
        return f"no change is shown: {interval}"
    wanted = "as trained" if found.found == course.direction else "against the training"
    return f"the reflex has gone {found.found}, {wanted}: {interval}"
