"""State K, B, I, G and the effective stiffness of a joint model at an operating point.

python examples/impedance_of_a_model.py
python examples/impedance_of_a_model.py --model diagnosis/model.yaml --position 0.1
"""

import argparse
from dataclasses import asdict

from ankle_physics.impedance import OperatingPoint, impedance
from ankle_physics.model import Model

UNITS = {"K": "N.m/rad", "B": "N.m.s/rad", "I": "kg.m^2", "G": "N.m.s/rad"}


def main() -> None:
    """Read the command line, state the impedance."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", help="model file; else the paper's with relaxation")
    parser.add_argument("--position", type=float, default=0.0, help="mean position [rad]")
    parser.add_argument("--torque", type=float, default=0.0, help="mean torque [N.m]")
    asked = parser.parse_args()

    terms = ("inertia", "viscosity", "stiffness", "reflex", "maxwell_relaxation")
    model = Model.load(asked.model) if asked.model else Model.of({name: {} for name in terms})
    stated = impedance(model, OperatingPoint(position=asked.position, torque=asked.torque))
    for symbol, value in asdict(stated).items():
        print(f"{symbol} = {value:.4g} {UNITS.get(symbol, 'N.m/rad')}")


if __name__ == "__main__":
    try:
        main()
    except (ValueError, OSError) as error:  # a wrong bag, model or path
        raise SystemExit(f"error: {error}") from None
