"""Has a reflex changed over a course? Comparison of its sessions with the baseline.

Two things make a change seem to be there where there is none. A course is looked at many times:
each comparison has its own chance of being wrong. And sessions are not independent: a good week
follows a good week, so the means of a few neighbouring sessions differ by more than their scatter
says. Therefore the comparison is made at fixed sessions only, which share one error rate, and the
correlation of sessions is part of the model:

    y_n = log(reflex of session n) = b + [n > m] (s + r (n - m)) + e_n,   corr(e_n, e_k) = φ^|n - k|

with m baseline sessions, a level b, a step s and a slope r of the conditioning sessions. The result
is the mean of s + r (n - m) over the last sessions. For a given φ it is a generalised least-squares
estimate with a t distribution; over φ it is averaged, weighted by the restricted likelihood, with
all values of φ equally likely beforehand. Diggle, Heagerty, Liang & Zeger, Analysis of
Longitudinal Data, Oxford 2002, sections 4.4 and 4.5: restricted likelihood of correlated series.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from biofeedback.session.course import CONDITIONED, DOWN, UP, Course
from biofeedback.session.course_record import CourseRecord, SessionResult

COMPARED_SESSIONS = 6
"""Number of conditioning sessions that each comparison with the baseline uses, and between two of
them: as many as the published course has baseline sessions, so that both means are equally sure."""
ERROR_RATE = 0.03
"""Share of courses without a change in which any of the comparisons states one, on average over the
correlations below. It is below 0.05 so that of the correlations that are harder, up to 0.8 for the
whole scatter or for half of it, none has more than this: `benchmarks/course_trends.py`."""
INTERIM_SHARE = 0.2
"""Share of that rate which all comparisons before the course's end have together. The end is what a
course is made for; before, only a change that leaves no doubt is worth a statement."""
MEANINGFUL_TRIALS = 0.5
"""Part of the planned trials below which a session's mean is left out: it was broken off early."""
MIN_SESSIONS = 2
"""Least number of sessions of the baseline and of those that are compared with it."""
CORRELATIONS = np.linspace(0.0, 0.95, 20)
"""Correlations of neighbouring sessions that are possible. Above, a reflex wanders so slowly that
no course of this length has a baseline."""


SMALLEST_SQUARES = 1e-12
"""Sum of squares of the logarithms that counts at least: a millionth of a reflex, so that a record
of equal numbers has an interval."""


@dataclass(frozen=True)
class Trend:
    """Holds the change of a reflex against the baseline sessions.

    Attributes
    ----------
    percent, lower, upper
        Reflex of the compared sessions in per cent of the baseline's, and the ends of its interval.
    level
        Confidence level of the interval [%]: so high that over all comparisons of a course at most
        one of twenty subjects who do not change shows a trend.
    compared
        Numbers of the first and the last session that are compared with the baseline.
    sessions
        Compared sessions and baseline sessions that it comes from.
    found
        ``up`` or ``down`` where the interval excludes 100 %, else ``none``.
    final
        Whether it is the comparison at the course's end.
    """

    percent: float
    lower: float
    upper: float
    level: float
    compared: tuple[int, int]
    sessions: tuple[int, int]
    found: str
    final: bool


def comparisons(course: Course) -> list[int]:
    """Return the numbers of the sessions after which the reflex is compared with the baseline."""
    step = min(COMPARED_SESSIONS, course.conditioning_sessions)
    ends = range(course.baseline_sessions + step, course.sessions + 1, step)
    return [*ends[:-1], course.sessions]


def error_rate(course: Course, end: int) -> float:
    """Return the rate of false trends that the comparison after session `end` may have."""
    earlier = len(comparisons(course)) - 1
    if earlier == 0:
        return ERROR_RATE
    if end == course.sessions:
        return ERROR_RATE * (1.0 - INTERIM_SHARE)
    return ERROR_RATE * INTERIM_SHARE / earlier


def trend(record: CourseRecord, course: Course, kind: str = CONDITIONED) -> Trend | None:
    """Compare the reflex of the last compared conditioning sessions with the baseline sessions.

    Parameters
    ----------
    record
        Record of the subject.
    course
        The plan of the course.
    kind
        `CONDITIONED`: the whole change in the trials that are rewarded. `CONTROL`: what stays
        without reward, the long-term change.

    Returns
    -------
    Trend | None
        The latest comparison; None before the first one, and where fewer than two sessions of
        either are complete.
    """
    reached = [end for end in comparisons(course) if end < record.next_session]
    if not reached:
        return None
    end = reached[-1]
    first = end - min(COMPARED_SESSIONS, course.conditioning_sessions) + 1
    used = [r for r in record.results if r.number <= end and _is_usable(r, course, kind)]
    numbers = np.array([r.number for r in used])
    count = int(np.sum(numbers >= first)), int(np.sum(numbers <= course.baseline_sessions))
    if min(count) < MIN_SESSIONS:
        return None
    logs = np.log([_reflex(r, course, kind) for r in used])
    rate = error_rate(course, end)
    quantiles = change_quantiles(numbers, logs, course.baseline_sessions, first, rate)
    low, middle, high = (100.0 * np.exp(quantiles)).tolist()
    found = DOWN if high < 100.0 else UP if low > 100.0 else "none"
    level = 100.0 * (1.0 - rate)
    return Trend(middle, low, high, level, (first, end), count, found, end == course.sessions)


def _reflex(result: SessionResult, course: Course, kind: str) -> float:
    conditioned = kind == CONDITIONED and result.number > course.baseline_sessions
    return result.conditioned if conditioned else result.control


def _is_usable(result: SessionResult, course: Course, kind: str) -> bool:
    value = _reflex(result, course, kind)
    complete = result.trials >= MEANINGFUL_TRIALS * result.planned
    return complete and math.isfinite(value) and value > 0.0


def change_quantiles(
    numbers: np.ndarray, logs: np.ndarray, baseline: int, first: int, rate: float
) -> np.ndarray:
    """Return the change of the sessions from `first` on against the baseline, with its interval.

    Parameters
    ----------
    numbers
        Numbers of the sessions, ascending; shape (n,).
    logs
        Logarithm of the reflex of each; shape (n,).
    baseline
        Number of the last baseline session.
    first
        Number of the first session that is compared.
    rate
        Probability outside of the interval, both sides together.

    Returns
    -------
    numpy.ndarray
        Lower end, median and upper end of the change of the logarithm.
    """
    # They take a while to load: only for those who compare.
    from scipy import optimize, special

    design = _design(numbers, baseline)
    freedom = len(numbers) - design.shape[1]
    contrast = design[numbers >= first].mean(axis=0) - design[0]
    estimate, error, weight = _fits(numbers, logs, design, contrast)

    def excess(value: float, probability: float) -> float:
        below = special.stdtr(freedom, (value - estimate) / error)
        return float(weight @ below) - probability

    out = []
    for probability in (0.5 * rate, 0.5, 1.0 - 0.5 * rate):
        each = estimate + error * special.stdtrit(freedom, probability)
        # The quantile of a mixture lies between those of its parts.
        out.append(
            optimize.brentq(excess, each.min() - 1e-9, each.max() + 1e-9, args=(probability,))
        )
    return np.array(out)


def _design(numbers: np.ndarray, baseline: int) -> np.ndarray:
    """Return level, step and slope of the model; shape (sessions, 3)."""
    after = np.maximum(numbers - baseline, 0)
    return np.column_stack((np.ones(len(numbers)), after > 0, after))


def _fits(
    numbers: np.ndarray, logs: np.ndarray, design: np.ndarray, contrast: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return estimate, standard error and weight of the contrast for each of `CORRELATIONS`."""
    freedom = len(numbers) - design.shape[1]
    apart = np.abs(np.subtract.outer(numbers, numbers))
    covariance = CORRELATIONS[:, None, None] ** apart
    weighted = np.linalg.solve(
        covariance, np.broadcast_to(design, (len(covariance), *design.shape))
    )
    normal = design.T @ weighted
    inverse = np.linalg.inv(normal)
    solution = np.einsum("kij,knj,n->ki", inverse, weighted, logs)
    rest = logs - solution @ design.T
    whitened = np.linalg.solve(covariance, rest[:, :, None])[:, :, 0]
    squares = np.maximum(np.sum(rest * whitened, axis=1), SMALLEST_SQUARES)
    variance = squares / freedom * np.einsum("i,kij,j->k", contrast, inverse, contrast)
    determinants = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(normal)[1]
    likelihood = -0.5 * (determinants + freedom * np.log(squares))
    weight = np.exp(likelihood - likelihood.max())
    return solution @ contrast, np.sqrt(variance), weight / weight.sum()
