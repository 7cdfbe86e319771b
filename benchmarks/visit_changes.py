"""How often `ankle study report` states a change: of subjects who do not change, and who do.

    .venv/bin/python benchmarks/visit_changes.py --studies 1000 --seed 41

Each study has 1 to 12 subjects with 2 to 8 visits, and its first subject counts. Neighbouring
visits are correlated as the first column says; in the last row half of the variance is correlated
by 0.8 from visit to visit and half is not: a process that the model of the report does not hold. A
change is four standard deviations of a visit, at the last visit. Beside it stands the usual
1.96 √2 standard errors of measurement, whose scatter is that of all subjects. The goal, set before
the counted seed was drawn: over all sizes, no correlation with more than 5 % of false changes.
"""

from __future__ import annotations

import argparse
import itertools
import math

import numpy as np
from scipy.stats import binomtest

from session_analysis.study.detectable_change import detectable_changes
from session_analysis.study.reliability import reliability

SUBJECTS, VISITS = (1, 2, 3, 6, 12), (2, 3, 5, 8)
PROCESSES = {f"{one:g}": (one,) for one in (0.0, 0.4, 0.8)} | {"0.8 and 0": (0.8, 0.0)}
"""Correlations of neighbouring visits; of several processes the mean is taken."""
BETWEEN_SUBJECTS = 3.0
"""Standard deviation of the subjects' levels, in those of a visit."""
TRUE_CHANGE = 4.0
"""A change of the last visit that is there, in standard deviations of a visit."""


def drawn(
    random: np.random.Generator, shape: tuple[int, int], parts: tuple[float, ...]
) -> np.ndarray:
    """Draw the values of a study, shape (subjects, visits)."""
    total = np.zeros(shape)
    for correlation in parts:
        series = random.normal(size=shape)
        for k in range(1, shape[1]):
            fresh = math.sqrt(1.0 - correlation**2) * series[:, k]
            series[:, k] = correlation * series[:, k - 1] + fresh
        total += series
    levels = BETWEEN_SUBJECTS * random.normal(size=(shape[0], 1))
    return levels + total / math.sqrt(len(parts))


def stated(values: np.ndarray) -> tuple[bool, bool]:
    """Tell whether the first subject's change is stated: by the report, and by 1.96 √2 SEM."""
    change = abs(values[0, -1] - values[0, 0])
    visits = range(1, values.shape[1] + 1)
    usual = 1.96 * math.sqrt(2.0) * reliability(values).sem
    return bool(change > detectable_changes(visits, values)[0]), bool(change > usual)


def share(count: int, of: int) -> str:
    interval = binomtest(count, of).proportion_ci()
    low, high = 100.0 * interval.low, 100.0 * interval.high
    return f"{100.0 * count / of:.1f} % ({low:.1f} to {high:.1f})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--studies", type=int, default=1000, help="of each size")
    parser.add_argument("--seed", type=int, default=41)
    given = parser.parse_args()
    random = np.random.default_rng(given.seed)
    sizes = list(itertools.product(SUBJECTS, VISITS))
    print(
        "| correlation | false changes | size with most | those of 1.96 √2 SEM | size with most "
        "| changes found |\n| --- | --- | --- | --- | --- | --- |"
    )
    for name, parts in PROCESSES.items():
        counts = np.zeros((len(sizes), 3), dtype=int)
        for row, size in zip(counts, sizes, strict=True):
            for _ in range(given.studies):
                values = drawn(random, size, parts)
                row[:2] += stated(values)
                values[0, -1] += TRUE_CHANGE
                row[2] += stated(values)[0]
        cells = [name]
        for column in counts.T[:2]:
            most = int(column.argmax())
            subjects, visits = sizes[most]
            cells += [
                share(int(column.sum()), given.studies * len(sizes)),
                f"{share(int(column[most]), given.studies)}, {subjects} subjects, {visits} visits",
            ]
        cells.append(f"{100.0 * counts[:, 2].mean() / given.studies:.0f} %")
        print("| " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
