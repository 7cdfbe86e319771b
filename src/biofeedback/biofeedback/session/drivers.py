"""Which rig drivers are in the graph, from the services that its nodes offer.

A driver is a node that offers ``arm``, ``start`` and ``stop`` as `std_srvs/srv/Trigger`. One that
was seen once stays known: a stop goes to every known driver, whatever discovery says just now.
Only one driver may be commanded to move; a second one is a fault.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

REQUIRED_SERVICES = frozenset(("arm", "start", "stop"))
ACTIONS = (*sorted(REQUIRED_SERVICES), "reset_fault")
NO_DRIVER = "no rig driver in this graph: arm, start and stop concern the session only"


class Drivers:
    """Keeps account of the rig drivers in the graph.

    Parameters
    ----------
    wanted
        Name of the driver node that may be commanded; empty takes the only one.

    Attributes
    ----------
    known
        Names of all drivers seen so far, in the order in which they came.
    selected
        Name of the driver that may be commanded to move; None while there is none or more than one.
    several
        Whether more than one driver is in the graph now.
    problem
        Why no driver is selected, or what is wrong with it; empty where nothing is.
    """

    def __init__(self, wanted: str = "") -> None:
        self._wanted = wanted.strip("/")
        self.known: list[str] = []
        self.selected: str | None = None
        self.several = False
        self.problem = NO_DRIVER

    def update(self, offered: Mapping[str, Iterable[str]]) -> None:
        """Process which node offers which of `ACTIONS`, as discovery says now.

        Parameters
        ----------
        offered
            Actions by the full name of the node, without the leading slash.
        """
        present = {name: set(actions) for name, actions in offered.items()}
        # A stop and something that moves make a driver, even while discovery lacks the rest.
        for name, actions in present.items():
            if "stop" in actions and actions & {"arm", "start"} and name not in self.known:
                self.known.append(name)
        here = [name for name in self.known if present.get(name)]
        self.several = len(here) > 1
        others = [name for name in here if self._wanted not in ("", name)]
        candidates = [name for name in here if name not in others]
        self.selected = candidates[0] if len(candidates) == 1 and not others else None
        self.problem = self._problem(here, candidates, present)

    def _problem(
        self, here: list[str], candidates: list[str], present: Mapping[str, set[str]]
    ) -> str:
        if len(here) > 1:
            return (
                f"{len(here)} rig drivers are in this graph ({', '.join(sorted(here))}): "
                "only one may be connected; end the other one"
            )
        if not candidates:
            return (
                f"the rig driver '{self._wanted}' is not in this graph"
                if self._wanted
                else NO_DRIVER
            )
        missing = sorted(REQUIRED_SERVICES - present[candidates[0]])
        return (
            f"{candidates[0]} does not offer {', '.join(missing)} at the moment" if missing else ""
        )
