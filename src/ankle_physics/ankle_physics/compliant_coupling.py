"""A coupling through which the plate drives the foot by a torque, such as straps that give way.

`foot_loop` finds the foot's motion behind it.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from ankle_physics.term import Term, Values


class CompliantCoupling(Term):
    """Describes a term at `Place.COUPLING` through which the plate drives the foot by a torque.

    Attributes
    ----------
    linear
        Whether the torque is proportional to extension and rate; False where `linearised` holds for
        small extensions only.
    """

    linear: ClassVar[bool] = True

    @abstractmethod
    def linearised(self, values: Values) -> tuple[float, float]:
        """Return the stiffness [N.m/rad] and damping [N.m.s/rad] of the coupling for small
        extensions.
        """

    @abstractmethod
    def coupling_torque(
        self, extension: np.ndarray, rate: np.ndarray, values: Values
    ) -> np.ndarray:
        """Return the torque [N.m] on the foot, shape (n,), for plate minus foot angle [rad] and its
        rate [rad/s].
        """
