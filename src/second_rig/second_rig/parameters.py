"""Every number of the rig and of the joint, by the part that it belongs to.

Each is a float: the compiled loop is then made once for all recordings.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from typing import NamedTuple

from second_rig.fixation import Fixation
from second_rig.servo import Servo
from second_rig.torques.air_cushion import AirCushion
from second_rig.torques.cross_bridges import CrossBridges
from second_rig.torques.elastic import Elastic
from second_rig.torques.friction import Friction, SlipElements
from second_rig.torques.reflex_arc import FurtherReflex, TonicReflex
from second_rig.torques.reflex_drive import Reflex
from second_rig.torques.relaxation import Relaxation
from second_rig.torques.tremor import Tremor
from second_rig.torques.viscous import Damping


class Parameters(NamedTuple):
    """Holds every number of rig and joint.

    Attributes
    ----------
    inertia
        Of the foot and what moves with it [kg.m^2].
    torque
        That the subject holds in the mean [N.m].
    elastic, damping, reflex
        The plain joint, and how it differs.
    servo, fixation
        The rig.
    relaxation, friction, slip_elements, cross_bridges, air_cushion
        What holds torque beside the joint's elasticity.
    tonic_reflex, late_reflex, antagonist_reflex, tremor
        Further activity of the muscles.
    """

    inertia: float
    torque: float
    elastic: Elastic
    damping: Damping
    reflex: Reflex
    servo: Servo = Servo()
    fixation: Fixation = Fixation()
    relaxation: Relaxation = Relaxation()
    friction: Friction = Friction()
    slip_elements: SlipElements = SlipElements()
    cross_bridges: CrossBridges = CrossBridges()
    air_cushion: AirCushion = AirCushion()
    tonic_reflex: TonicReflex = TonicReflex()
    late_reflex: FurtherReflex = FurtherReflex()
    antagonist_reflex: FurtherReflex = FurtherReflex()
    tremor: Tremor = Tremor()


def changed(parameters: Parameters, changes: Mapping[str, float]) -> Parameters:
    """Return the parameters with some numbers replaced.

    Parameters
    ----------
    parameters
        To start from.
    changes
        New number by part and name, such as ``friction.torque``.

    Raises
    ------
    ValueError
        A name is unknown.
    """
    by_part: dict[str, dict[str, float]] = defaultdict(dict)
    for path, value in changes.items():
        part, _, name = path.partition(".")
        by_part[part][name] = float(value)
    parts = {part: getattr(parameters, part)._replace(**new) for part, new in by_part.items()}
    return parameters._replace(**parts)
