"""Simulate with a physical effect of your own: one file with one class.

    python examples/add_a_term.py

The file is `terms/cubic_stiffness.py`. Here its folder is added to the search path; in a copy of
this repository, put the file into `src/ankle_physics/ankle_physics/terms/` instead.
"""

from pathlib import Path

import numpy as np

from ankle_physics import terms

terms.__path__.append(str(Path(__file__).parent / "terms"))

from ankle_physics.model import PAPER_TERMS, Model  # noqa: E402
from ankle_physics.virtual_rig import simulate  # noqa: E402

RATE = 2048.0  # Hz


def main() -> None:
    """Simulate with and without the term, and show the difference."""
    phase = 2 * np.pi * 0.5 * np.arange(round(4 * RATE)) / RATE
    amplitude, w = 0.15, 2 * np.pi * 0.5
    reference = amplitude * np.column_stack(
        [np.sin(phase), w * np.cos(phase), -(w**2) * np.sin(phase)]
    )
    paper = {name: {} for name in PAPER_TERMS}
    plain = simulate(reference, RATE, Model.of(paper))
    own = simulate(reference, RATE, Model.of({**paper, "cubic_stiffness": {"k3": 4000.0}}))
    largest = np.abs(own.clean[:, 2] - plain.clean[:, 2]).max()
    print(f"the term adds up to {largest:.2f} N.m; k3 * x^3 = {4000.0 * amplitude**3:.2f} N.m")


if __name__ == "__main__":
    main()
