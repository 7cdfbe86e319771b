"""The motion that a block of the reference asks for."""

from __future__ import annotations

import numpy as np

from ankle_interfaces.block import Block
from ankle_interfaces.topics import PERTURBATION_REFERENCE


def motion_of(block: Block) -> tuple[np.ndarray, np.ndarray, str]:
    """Return the times and the motion of a block of the reference, and what it falls short of.

    Parameters
    ----------
    block
        Time and position [rad], and where they are known velocity [rad/s] and acceleration
        [rad/s^2].

    Returns
    -------
    tuple
        Times [s], shape (n,); motion, shape (n, 3), or (n, 1) where only the position is known; a
        sentence, empty where nothing is missing.
    """
    if block.columns == PERTURBATION_REFERENCE.columns:
        return block.data[:, 0], block.data[:, 1:], ""
    return (
        block.data[:, 0],
        block.data[:, 1:2],
        "without velocity and acceleration; position taken as linear between samples",
    )
