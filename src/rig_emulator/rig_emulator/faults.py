"""What can go wrong at the rig, as switches: ``drop=0.1,corrupt=0.01,emergency_stop=1``.

`Faults` says what each does.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

from ankle_interfaces.errors import QuantityError


@dataclass(frozen=True)
class Faults:
    """Holds the switches of the rig's faults, each 0 (off) to 1.

    Attributes
    ----------
    drop
        Part of the packets that are lost, each way.
    duplicate
        Part of the packets that come twice.
    reorder
        Part of the packets that later ones overtake.
    corrupt
        Part of the packets with some flipped bits.
    burst
        Seconds for which all packets wait, once a second.
    freeze
        The controller's communication hangs: nothing comes or goes; its servo lives on.
    encoder_stuck
        The measured position stays where it is.
    encoder_slip
        Radians by which the measured position slips at once.
    encoder_spikes
        Part of the samples whose position is 0.3 rad off.
    position_saturated
        The measured position is at the end of its range.
    position_nan
        The measured position is not a number.
    velocity_stuck
        The measured velocity is zero.
    velocity_saturated
        The measured velocity is at the end of its range.
    velocity_spikes
        Part of the samples whose velocity is 3 rad/s off.
    velocity_nan
        The measured velocity is not a number.
    torque_dead
        The torque sensor shows its noise only.
    torque_stuck
        The measured torque stays as it is.
    torque_spikes
        Part of the samples whose torque is 50 N.m off.
    torque_nan
        The measured torque is not a number.
    torque_saturated
        The torque sensor is at the end of its range.
    torque_swings
        Part of 100 N.m, the amplitude of a torque that swings 8 times a second.
    nan
        All samples are not a number.
    no_samples
        The state is reported without samples.
    ignore_off
        The rig stays powered though it is commanded to switch off.
    ignore_reference
        The plate is held though the rig says that it follows.
    unchecked
        The rig checks nothing: no limits, no sensors, no torque.
    emergency_stop
        The button at the rig is pressed.
    """

    drop: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    corrupt: float = 0.0
    burst: float = 0.0
    freeze: float = 0.0
    encoder_stuck: float = 0.0
    encoder_slip: float = 0.0
    encoder_spikes: float = 0.0
    position_saturated: float = 0.0
    position_nan: float = 0.0
    velocity_stuck: float = 0.0
    velocity_saturated: float = 0.0
    velocity_spikes: float = 0.0
    velocity_nan: float = 0.0
    torque_dead: float = 0.0
    torque_stuck: float = 0.0
    torque_spikes: float = 0.0
    torque_nan: float = 0.0
    torque_saturated: float = 0.0
    torque_swings: float = 0.0
    nan: float = 0.0
    no_samples: float = 0.0
    ignore_off: float = 0.0
    ignore_reference: float = 0.0
    unchecked: float = 0.0
    emergency_stop: float = 0.0

    def with_switches(self, text: str) -> Faults:
        """Return the switches changed by ``name=value`` pairs, joined by commas.

        The word ``none`` turns all off.

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
        """Return the switches that are on, in the form that `with_switches` reads."""
        return (
            ",".join(f"{name}={getattr(self, name):g}" for name in _NAMES if getattr(self, name))
            or "none"
        )


_NAMES = tuple(field.name for field in fields(Faults))
