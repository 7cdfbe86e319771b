"""Simulate a joint on the paper's rig and keep the recording as a bag.

    python examples/simulate_a_model.py my_bag --stiffness 80 --reflex-gain 12

Any program of ROS opens the bag; `ankle estimate my_bag` estimates K and G from it. With --table it
is also written as a table, as a laboratory without ROS has it.
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

BLOCK = 32  # samples of a message, as on a rig


def main() -> None:
    """Read the command line, simulate, write the bag."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bag")
    parser.add_argument("--stiffness", type=float, default=80.0, help="K [N.m/rad]")
    parser.add_argument("--reflex-gain", type=float, default=12.0, help="G [N.m.s/rad]")
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--table", help="a CSV file of the same recording, in degrees")
    asked = parser.parse_args()

    gains = {"stiffness": {"K": asked.stiffness}, "reflex": {"G": asked.reflex_gain}}
    joint = Model.of({"inertia": {}, "viscosity": {}, **gains})
    perturbation = signal_from({p.name: p.default for p in PARAMETERS})
    rate = perturbation.settings.rate
    reference = perturbation.next(round(asked.seconds * rate))
    recording = simulate(reference, rate, joint, seed=1)
    streams = ((PERTURBATION_REFERENCE, reference), (ANKLE_SAMPLES, recording.measured))
    with BagWriter(asked.bag) as bag:
        for topic, values in streams:
            bag.add_topic(topic.absolute, topic.message)
            rows = np.column_stack([recording.time, values])
            for start in range(0, len(rows), BLOCK):
                block = Block(topic.columns_of(rows.shape[1]), rows[start : start + BLOCK])
                bag.write_block(topic.absolute, block)
    print(f"{asked.seconds:g} s in {asked.bag}")
    if asked.table:
        position, torque = recording.measured[:, 0], recording.measured[:, -1]
        angles = np.degrees([reference[:, 0], position])
        table = np.column_stack([recording.time, *angles, torque])
        names = "Time (s),Commanded Angle (deg),Ankle Angle (deg),Torque (Nm)"
        np.savetxt(asked.table, table, "%.9g", ",", header=names, comments="")
        print(f"and as a table in {asked.table}")


if __name__ == "__main__":
    main()
