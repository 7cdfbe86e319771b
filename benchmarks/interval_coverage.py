"""How often the 95 % interval of Table III holds the true correlation, at the paper's numbers of
holds.

.venv/bin/python benchmarks/interval_coverage.py --trials 300 --resamples 999   # the figures of
docs/table3.md
"""

from __future__ import annotations

import argparse
import sys

import numpy as np

from ankle_sim.procedure import PAPER_HOLDS
from session_analysis.coverage import coverage


def main() -> int:
    """Run and print a table."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--trials", type=int, default=1000)
    options.add_argument("--resamples", type=int, default=1999)
    chosen = options.parse_args()
    for holds in np.array(PAPER_HOLDS).T:
        for r in (0.0, 0.5, 0.8, 0.9):
            share = coverage(r, holds.tolist(), chosen.trials, chosen.resamples, seed=1)
            error = (share * (1.0 - share) / chosen.trials) ** 0.5
            print(
                f"N = {holds.sum():2d}  r = {r:.1f}  {100 * share:.1f} % (standard error "
                f"{100 * error:.1f} %)",
                flush=True,
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
