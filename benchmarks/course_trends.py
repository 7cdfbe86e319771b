"""How often a conditioning course states a trend: of subjects who do not change, and who learn.

    .venv/bin/python benchmarks/course_trends.py --subjects 1000 --seed 1

Each subject does the 30 sessions of `down_training`. A session's reflex differs from day to day by
8 %; neighbouring sessions are correlated as the first column says. In the last row half of the
variance is correlated by 0.8 from session to session and half is not: a process that the model of
the comparison does not hold. Learning is 2 % a session, or as much in the end, but at once. A trend
counts where any of the comparisons of the course states it, not only the last one.
"""

from __future__ import annotations

import argparse
import math

import numpy as np

from biofeedback.session.course import DOWN, Course, load_course
from biofeedback.session.course_record import CourseRecord, SessionResult, new_record
from biofeedback.session.course_trend import comparisons, trend

DAY_SPREAD = 0.08
"""Standard deviation of a reflex' logarithm from session to session, as the simulated subject's."""
LEARNING_PER_SESSION = 0.02
"""Part of the reflex that is lost in a session of learning."""

PROCESSES = {f"{one:g}": (one,) for one in (0.0, 0.2, 0.4, 0.6, 0.7, 0.8)} | {
    "0.8 and 0": (0.8, 0.0)
}
"""Correlations of neighbouring sessions; of several processes the mean is taken."""


def correlated(random: np.random.Generator, count: int, correlation: float) -> np.ndarray:
    """Draw a stationary series of variance 1 whose neighbours are correlated."""
    series = random.normal(size=count)
    for n in range(1, count):
        series[n] = correlation * series[n - 1] + math.sqrt(1.0 - correlation**2) * series[n]
    return series


def drawn(random: np.random.Generator, count: int, parts: tuple[float, ...]) -> np.ndarray:
    """Draw the logarithms of a subject's reflex."""
    total = sum((correlated(random, count, one) for one in parts), np.zeros(count))
    return DAY_SPREAD * total / math.sqrt(len(parts))


def record_of(course: Course, logs: np.ndarray) -> CourseRecord:
    record = new_record(course, "S01")
    for n, size in enumerate(np.exp(logs).tolist(), 1):
        record.results.append(SessionResult(n, "2026-01-01", 225, 225, size, size, 0.5))
    return record


def ever_found(course: Course, logs: np.ndarray) -> set[str]:
    """What the comparisons of a course state, each with the sessions done by then."""
    found = (trend(record_of(course, logs[:end]), course) for end in comparisons(course))
    return {one.found for one in found if one is not None} - {"none"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--subjects", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    random = np.random.default_rng(given.seed)
    course = load_course("down_training")
    after = np.maximum(np.arange(1, course.sessions + 1) - course.baseline_sessions, 0)
    slow = math.log1p(-LEARNING_PER_SESSION) * after
    changes = (np.zeros(course.sessions), slow, slow[-1] * (after > 0))
    print("correlation | trend stated without a change | learning found | change at once found")
    for name, parts in PROCESSES.items():
        counts = []
        for change in changes:
            subjects = [
                change + drawn(random, course.sessions, parts) for _ in range(given.subjects)
            ]
            found = [ever_found(course, logs) for logs in subjects]
            counts.append(sum(one == {DOWN} if change.any() else bool(one) for one in found))
        print(f"{name} | " + " | ".join(f"{100 * c / given.subjects:.1f} %" for c in counts))


if __name__ == "__main__":
    main()
