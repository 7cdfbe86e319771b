"""A part of the rig that swings on the footplate, beside the path of the load.

``y'' + 2 z w y' + w^2 y = 2 z w x' + w^2 x``, ``torque = Ia * y''``; x is the plate, y the part.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ankle_physics.linear_dynamics import SecondOrder
from ankle_physics.signals import Signals
from ankle_physics.term import ModelValues, Owner, Parameter, Place, State, Term, Values


class PlateAppendage(Term):
    """Models a cable, a handle, a counterweight or a loose cover: an inertia on a spring and a
    damper.

    It adds its own torque to the plate and takes nothing from the joint's, which tells it from a
    resonance in the load path (`torque_sensor_mode`). It has the equation of a damped vibration
    absorber: Den Hartog 1934 (Mechanical Vibrations).
    """

    name = "plate_appendage"
    place = Place.COUPLING
    belongs_to = Owner.RIG
    family = "resonance beside the load path"
    separated_by = "the same movement with the foot out of the plate"
    sentence = "Something that hangs on the footplate swings after each movement."
    rings = True
    parameters = (
        Parameter(
            "Ia",
            "kg.m^2",
            0.0,
            0.05,
            0.002,
            "by reasoning: from a cable (0.2 kg at 0.05 m) to a plate of 2 kg at 0.15 m",
            description="It is the inertia of the part that swings.",
            linear=True,
        ),
        Parameter(
            "frequency",
            "Hz",
            3.0,
            150.0,
            20.0,
            "by reasoning: cables swing at some hertz, metal parts up to the recorded band",
            description="It is the natural frequency of the part that swings.",
            # A light part is found from within a fifth of its frequency.
            tried=(5.0, 8.0, 12.0, 18.0, 27.0, 40.0, 60.0, 90.0),
        ),
        Parameter(
            "damping",
            "1",
            0.01,
            0.4,
            0.1,
            "metal structures 0.01 to 0.05, cables up to 0.3; with more than 0.4 nothing swings",
            description="It is the damping ratio of the part that swings.",
            tried=(0.03, 0.1, 0.3),
        ),
    )

    @classmethod
    def imitated_by(cls, model: Mapping[str, Values]) -> dict[str, ModelValues]:
        own = model[cls.name]
        omega, swings = 2.0 * np.pi * float(own["frequency"]), float(own["Ia"])
        if "inertia" not in model or swings <= 0.0:
            return {}
        inertia = float(model["inertia"]["I"])
        # What swings is the foot, and what follows the plate is the plate.
        straps = {"k_s": swings * omega**2, "b_s": 2.0 * float(own["damping"]) * omega * swings}
        return {
            "fixation_compliance": {
                "fixation_compliance": straps,
                "inertia": {"I": swings},
                "footplate_inertia": {"Ip": inertia},
            }
        }

    def start(self, rate: float, seed: int = 0) -> State:
        return {"mode": SecondOrder(rate)}

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        omega = 2.0 * np.pi * float(values["frequency"])
        damping = float(values["damping"])
        y, rate, _ = state["mode"].run_with_rates(signals.acceleration, omega, damping)
        return {"Ia": y + 2.0 * damping / omega * rate}
