"""What can go wrong at the rig, as switches: ``drop=0.1,corrupt=0.01,emergency_stop=1``.

| switch | value | what happens |
| --- | --- | --- |
| drop, duplicate, reorder, corrupt | part of the packets, each way | lost; sent twice; overtaken by later ones; some bits flipped |
| burst | seconds | once a second all packets wait so long |
| freeze | 0 or 1 | the controller's communication hangs: nothing comes or goes; its servo lives on |
| encoder_stuck | 0 or 1 | the measured position stays where it is |
| torque_saturated | 0 or 1 | the torque sensor is at the end of its range |
| emergency_stop | 0 or 1 | the button at the rig is pressed |
"""  # noqa: E501

from __future__ import annotations

from dataclasses import dataclass, fields, replace

from ankle_interfaces.errors import QuantityError


@dataclass(frozen=True)
class Faults:
    """The switches; see the module. 0 is off."""

    drop: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    corrupt: float = 0.0
    burst: float = 0.0
    freeze: float = 0.0
    encoder_stuck: float = 0.0
    torque_saturated: float = 0.0
    emergency_stop: float = 0.0

    def with_switches(self, text: str) -> Faults:
        """These, changed by ``name=value`` pairs joined by commas; ``none`` turns all off.

        Raises
        ------
        QuantityError
            Another form, an unknown switch or a value outside 0 to 1.
        """
        changed: dict[str, float] = {}
        start = self
        for item in filter(None, (part.strip() for part in text.split(","))):
            name, _, value = item.partition("=")
            if item == "none":
                start, changed = Faults(), {}
                continue
            if name not in _NAMES:
                raise QuantityError(
                    f"fault switch '{item}' is unknown; known: {', '.join(_NAMES)}, none"
                )
            try:
                changed[name] = float(value)
            except ValueError:
                raise QuantityError(
                    f"fault switch '{item}' is not '{name}=value', as in '{name}=1'"
                ) from None
            if not 0.0 <= changed[name] <= 1.0:
                raise QuantityError(
                    f"fault switch {name} = {changed[name]:g} is refused; allowed: 0 to 1"
                )
        return replace(start, **changed)

    def line(self) -> str:
        """The switches that are on, as `with_switches` takes them."""
        return (
            ",".join(f"{name}={getattr(self, name):g}" for name in _NAMES if getattr(self, name))
            or "none"
        )


_NAMES = tuple(field.name for field in fields(Faults))
