"""Read a bag: what is in it, and one signal as an array.

python examples/read_a_bag.py my_bag
"""

import argparse

from ankle_interfaces.topics import ANKLE_SAMPLES
from session_recorder.bag_reader import BagReader


def main() -> None:
    """Read the command line, show the bag."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bag")
    bag = BagReader(parser.parse_args().bag)

    print(f"{bag.duration:.1f} s, {bag.count} messages")
    for name, topic in bag.topics.items():
        print(f"{name}: {topic.count} messages of {topic.type}")

    columns, data = bag.signal(ANKLE_SAMPLES.absolute)
    rate = (len(data) - 1) / (data[-1, 0] - data[0, 0])
    print(f"{len(data)} samples at {rate:.0f} Hz")
    for name, values in zip(columns[1:], data[:, 1:].T, strict=True):
        print(f"{name}: mean {values.mean():.4g}, standard deviation {values.std():.4g}")


if __name__ == "__main__":
    try:
        main()
    except (ValueError, OSError) as error:  # a wrong bag, model or path
        raise SystemExit(f"error: {error}") from None
