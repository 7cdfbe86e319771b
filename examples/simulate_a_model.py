"""Simulate a joint on the paper's rig; keep the recording as a bag, or as a table too.

python examples/simulate_a_model.py my_bag --stiffness 80 --reflex-gain 12 --table my.csv
"""

import argparse

import numpy as np

from ankle_interfaces.block import Block
from ankle_interfaces.topics import ANKLE_SAMPLES, PERTURBATION_REFERENCE
from ankle_physics.model import Model
from ankle_physics.virtual_rig import simulate
from perturbation_generator.parameters import PARAMETERS
from perturbation_generator.signals import signal_from
from session_recorder.bag_writer import BagWriter

NAMES = "Time (s),Commanded Angle (deg),Ankle Angle (deg),Torque (Nm)"


def main() -> None:
    """Read the command line, simulate, write the bag and the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bag")
    parser.add_argument("--stiffness", type=float, default=80.0, help="K [N.m/rad]")
    parser.add_argument("--reflex-gain", type=float, default=12.0, help="G [N.m.s/rad]")
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--table", help="a CSV file of the same recording, in degrees")
    asked = parser.parse_args()
    gains = {"stiffness": {"K": asked.stiffness}, "reflex": {"G": asked.reflex_gain}}
    perturbation = signal_from({p.name: p.default for p in PARAMETERS})
    rate = perturbation.settings.rate
    reference = perturbation.next(round(asked.seconds * rate))
    made = simulate(reference, rate, Model.of({"inertia": {}, "viscosity": {}, **gains}), seed=1)
    with BagWriter(asked.bag) as bag:
        for topic, values in ((PERTURBATION_REFERENCE, reference), (ANKLE_SAMPLES, made.measured)):
            bag.add_topic(topic.absolute, topic.message)
            rows = np.column_stack([made.time, values])
            for part in np.split(rows, range(32, len(rows), 32)):  # a message has 32, as on a rig
                bag.write_block(topic.absolute, Block(topic.columns_of(rows.shape[1]), part))
    if asked.table:
        rows = np.c_[made.time, np.degrees(np.c_[reference[:, 0], made.position]), made.torque]
        np.savetxt(asked.table, rows, "%.9g", ",", header=NAMES, comments="")


if __name__ == "__main__":
    try:
        main()
    except (ValueError, OSError) as error:  # a wrong bag, model or path
        raise SystemExit(f"error: {error}") from None
