"""Talk to a rig over a line of your own: one file with one class.

    python examples/own_link.py

The file is `links/echo_line.py`. Here its folder is added to the search path; in a package of your
own, name it as an entry point of the group `ankle_actuator_driver.links`.
"""

import time
from pathlib import Path

from ankle_actuator_driver import link, settings
from ankle_actuator_driver.link.rig_link import Clocks, link_names, open_link
from ankle_actuator_driver.safety.rig import Order, Wanted

link.__path__.append(str(Path(__file__).parent / "links"))


def main() -> None:
    """Open the line and tell the rig to hold."""
    values = {parameter.name: parameter.default for parameter in settings.PARAMETERS}
    print(f"lines: {', '.join(link_names())}")
    line = open_link("echo_line", values, Clocks(lambda: (time.monotonic(), time.time())))
    for wanted in (Wanted.OFF, Wanted.HOLD):
        line.send(Order(wanted, resets=0))
        (arrival,) = line.receive(0.1)
        print(f"wanted {wanted.name}, the rig reports {arrival.event.state.name}")
    line.close()


if __name__ == "__main__":
    main()
