"""Estimate joint impedance from a bag, sample by sample as the node does it.

python examples/estimate_a_bag.py my_bag
"""

import argparse

from impedance_estimator.offline.recorded_estimates import estimate_bag


def main() -> None:
    """Read the command line, estimate, show the median and the last estimate."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bag")
    parser.add_argument("--algorithm", default="simultaneous", help="or CE, C, O of the paper")
    asked = parser.parse_args()

    result = estimate_bag(asked.bag, algorithm=asked.algorithm)
    for note in result.notes:
        print(f"note: {note}")
    print(f"{len(result.valid)} of {len(result.rows)} estimates are valid")
    if len(result.valid):
        for name, value in result.median().items():
            print(f"median {name} = {value:.4g}")


if __name__ == "__main__":
    try:
        main()
    except (ValueError, OSError) as error:  # a wrong bag, model or path
        raise SystemExit(f"error: {error}") from None
