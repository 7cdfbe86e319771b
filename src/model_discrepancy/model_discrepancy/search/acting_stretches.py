"""A candidate counts only if it acts in many stretches of a recording."""

from __future__ import annotations

import numpy as np

# Longer than a response of the reflex (0.5 s), so that each response keeps its shape.
STRETCH_S = 1.0
# A candidate that acts in fewer stretches answers to single ones of them, as a threshold does that
# only the fastest movement passes: by chance it gains more than three times what one gains that
# acts in all of them (Student's t of so few degrees of freedom, at 0.005 among fifty candidates).
FEWEST_STRETCHES = 8.0


def stretch_numbers(time: np.ndarray) -> np.ndarray:
    """Return the number of the stretch that each row lies in, shape (rows,).

    Parameters
    ----------
    time
        Of the rows [s], shape (rows,).
    """
    numbers: np.ndarray = (time / STRETCH_S).astype(int)
    return numbers


def acting_stretches(energies: np.ndarray) -> float:
    """Return the number of equally strong stretches that would spread an energy as much.

    Parameters
    ----------
    energies
        Of what a candidate changes in each stretch, shape (stretches,).
    """
    largest = float(np.max(energies, initial=0.0))
    if not 0.0 < largest < np.inf:
        return 0.0
    # A candidate that is not fitted yet may have energies whose squares exceed any number.
    shares = energies / largest
    return float(np.sum(shares)) ** 2 / float(np.sum(shares**2))


def acting_in(time: np.ndarray, changes: np.ndarray) -> float:
    """Return in how many stretches a change of the whitened torque acts.

    Parameters
    ----------
    time
        Of the rows [s], shape (rows,).
    changes
        One column or several, shape (rows,) or (rows, p).
    """
    energy = changes**2 if changes.ndim == 1 else np.einsum("ij,ij->i", changes, changes)
    return acting_stretches(np.bincount(stretch_numbers(time), energy))
