"""A simulated rig with hidden imperfections, and the subject in it, drawn from a seed.

The plate has an inertia, the straps give way, the torque is read late, and the servo gives way.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
import yaml

from ankle_physics.actuator import Servo
from ankle_physics.model import Model
from ankle_physics.rig_file import Measured, RigFile

STREAM = 61
"""Labels the seeds of these rigs, so that they are not those of any other draw."""
TORQUE_DELAY = 0.001
"""[s] The torque is read so much later than the position: one cycle of a rig controller's loop."""
PLATE_INERTIA = (0.003, 0.010)
"""[kg.m^2] The lighter half of the plates that the term `footplate_inertia` is typical for."""
SERVO_STIFFNESS = (1000.0, 3000.0)
"""[N.m/rad] From the softest servo for which the estimator is unbiased to the typical value of the
term `servo_compliance`."""
STRAP_STIFFNESS = (400.0, 2450.0)
"""[N.m/rad] From strong to weak as an effect, as on the independent rig (`blind_rig.magnitudes`).
"""
STRAP_VISCOSITY = (0.3, 1.5)
"""[N.m.s/rad] As on the independent rig (`blind_rig.effects`)."""
STIFFNESS, REFLEX_GAIN = (50.0, 125.0), (5.0, 10.7)
"""K [N.m/rad] and G [N.m.s/rad] before they rise; behind the rise they end at 150 and 15, as in van
't Veld et al. 2018, section III-A."""
RISE_OF_STIFFNESS, RISE_OF_REFLEX_GAIN = 1.2, 1.4
"""K and G rise by 20 and 40 % while they are estimated, so that they are not those of the
calibration."""
NOISE = {"position[rad]": 4.5e-5, "velocity[rad/s]": 6.5e-3, "torque[N.m]": 0.14}
"""Standard deviation of each channel, about that of the paper's signal-to-noise ratios."""


@dataclass(frozen=True)
class ImperfectRig:
    """Describes the rig and the subject of a demonstration.

    Attributes
    ----------
    rig
        The true rig, which only the simulation knows.
    subject
        The true subject in its straps.
    """

    rig: RigFile
    subject: Model

    @property
    def stiffness(self) -> float:
        """Return the true K before it rises [N.m/rad]."""
        return float(self.subject.entry("stiffness").values["K"])

    @property
    def reflex_gain(self) -> float:
        """Return the true G before it rises [N.m.s/rad]."""
        return float(self.subject.entry("reflex").values["G"])

    def save(self, folder: Path, rises_at: float) -> dict[str, Path]:
        """Write what the simulation loads, and return the files by the node's parameter.

        Parameters
        ----------
        folder
            Receives ``rig.yaml``, ``model.yaml`` and ``scenario.yaml``.
        rises_at
            When K and G rise [s].
        """
        folder.mkdir(parents=True, exist_ok=True)
        files = {name: folder / f"{name}.yaml" for name in ("rig", "model", "scenario")}
        self.rig.save(files["rig"])
        self.subject.save(files["model"])
        rise = {
            "at[s]": rises_at,
            "stiffness.K[N.m/rad]": RISE_OF_STIFFNESS * self.stiffness,
            "reflex.G[N.m.s/rad]": RISE_OF_REFLEX_GAIN * self.reflex_gain,
        }
        content = {"scenario": "stiffness and reflex gain rise", "changes": [rise]}
        files["scenario"].write_text(yaml.safe_dump(content, sort_keys=False))
        return files


def draw_imperfect_rig(seed: int) -> ImperfectRig:
    """Return the rig and the subject of a seed."""
    random = np.random.default_rng([STREAM, seed])
    # Evenly on a logarithmic scale: what straps change goes with one over their stiffness.
    straps = {
        "k_s": math.exp(random.uniform(*np.log(STRAP_STIFFNESS))),
        "b_s": float(random.uniform(*STRAP_VISCOSITY)),
    }
    plate = float(random.uniform(*PLATE_INERTIA))
    servo_stiffness = float(random.uniform(*SERVO_STIFFNESS))
    usual = Servo()
    rig = RigFile(
        f"simulated rig, seed {seed}",
        datetime.now(timezone.utc),
        torque_delay=Measured(TORQUE_DELAY),
        noise=NOISE,
        bandwidth=Measured(usual.bandwidth),
        damping=Measured(usual.damping),
        model=Model.of(
            {
                "footplate_inertia": {"Ip": plate},
                "servo_compliance": {"k_a": servo_stiffness},
            }
        ),
    )
    subject = Model.of(
        {
            "inertia": {},
            "viscosity": {},
            "stiffness": {"K": float(random.uniform(*STIFFNESS))},
            "reflex": {"G": float(random.uniform(*REFLEX_GAIN))},
            "fixation_compliance": straps,
            "voluntary_torque": {},
        },
        f"simulated subject, seed {seed}",
    )
    return ImperfectRig(rig, subject)
