"""What a stream says about itself, and which of its channels are which muscle, in volts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from emg_driver.errors import StreamRefused
from emg_driver.muscles import MUSCLES

LOWEST_RATE, HIGHEST_RATE = 1000.0, 20_000.0
"""[Hz] Below, half the rate cuts into EMG (up to 450 Hz); above, no amplifier streams."""

VOLTS = {
    "v": 1.0,
    "volt": 1.0,
    "volts": 1.0,
    "mv": 1e-3,
    "millivolt": 1e-3,
    "millivolts": 1e-3,
    "uv": 1e-6,
    "µv": 1e-6,
    "μv": 1e-6,
    "microvolt": 1e-6,
    "microvolts": 1e-6,
    "nv": 1e-9,
    "nanovolt": 1e-9,
    "nanovolts": 1e-9,
}
"""Spellings of units that amplifiers put into their channel descriptions, in lower case."""


@dataclass(frozen=True)
class StreamDescription:
    """Describes a Lab Streaming Layer stream.

    Attributes
    ----------
    name, type, source_id
        As the sender names it.
    session
        Tells one start of the sender from the next.
    rate
        Nominal sampling rate [Hz]; 0 for irregular.
    labels
        Of the channels; empty texts where there are none.
    units
        Of the channels, as declared; empty texts where there are none.
    """

    name: str
    type: str
    source_id: str
    session: str
    rate: float
    labels: tuple[str, ...]
    units: tuple[str, ...]

    @property
    def title(self) -> str:
        """Return the name of the stream in messages."""
        return f"stream '{self.name}'" + (f" ({self.source_id})" if self.source_id else "")


@dataclass(frozen=True)
class ChannelMap:
    """Holds the channel of each muscle.

    Attributes
    ----------
    index
        Channel of each muscle, shape (4,).
    to_volts
        Factor of each, shape (4,).
    """

    index: np.ndarray
    to_volts: np.ndarray

    def volts(self, samples: np.ndarray) -> np.ndarray:
        """Return EMG [V] of shape (n, 4), in the order of `MUSCLES`.

        The samples have the shape (n, channels).
        """
        return samples[:, self.index].astype(float) * self.to_volts


def parse_channels(text: str) -> dict[str, str]:
    """Return ``SOL=soleus,TA=1`` as a mapping from muscle to channel label or index.

    Raises
    ------
    StreamRefused
        Another form, an unknown muscle, or a muscle that is missing.
    """
    wanted = {}
    for part in text.split(","):
        muscle, equals, channel = (piece.strip() for piece in part.partition("="))
        if not equals or muscle not in MUSCLES or not channel:
            raise StreamRefused(
                f"channels '{text}': '{part.strip()}' is not 'MUSCLE=label or index' with a "
                f"muscle of {', '.join(MUSCLES)}"
            )
        wanted[muscle] = channel
    missing = [muscle for muscle in MUSCLES if muscle not in wanted]
    if missing:
        raise StreamRefused(f"channels '{text}' does not say where {', '.join(missing)} is")
    return wanted


def map_channels(
    stream: StreamDescription, channels: str, unit: str, rate: float = 0.0
) -> ChannelMap:
    """Find the muscles in a stream.

    Parameters
    ----------
    stream
        What the stream says of itself.
    channels
        As `parse_channels` takes it; an index counts from 0. A label counts first.
    unit
        Of all channels; empty takes what the stream declares.
    rate
        That the stream must have [Hz]; 0 takes any.

    Raises
    ------
    StreamRefused
        A rate that is irregular, out of range or another than `rate`; a channel that is not there;
        a unit that is not declared or not one of voltage.
    """
    if not LOWEST_RATE <= stream.rate <= HIGHEST_RATE:
        raise StreamRefused(
            f"{stream.title} declares {stream.rate:g} Hz; allowed for EMG: {LOWEST_RATE:g} to "
            f"{HIGHEST_RATE:g} Hz at regular intervals"
        )
    if rate and abs(stream.rate - rate) > 1e-3 * rate:
        raise StreamRefused(
            f"{stream.title} declares {stream.rate:g} Hz, the parameter 'rate' asks for {rate:g} Hz"
        )
    wanted = parse_channels(channels)
    index = [_find(stream, muscle, wanted[muscle]) for muscle in MUSCLES]
    factors = [
        _to_volts(stream, muscle, number, unit)
        for muscle, number in zip(MUSCLES, index, strict=True)
    ]
    return ChannelMap(np.array(index), np.array(factors))


def _find(stream: StreamDescription, muscle: str, channel: str) -> int:
    if channel in stream.labels:
        return stream.labels.index(channel)
    count = len(stream.labels)
    if channel.isdigit():
        if int(channel) < count:
            return int(channel)
        raise StreamRefused(
            f"{stream.title} has {count} channels, counted from 0; {muscle} is to be channel "
            f"{channel}"
        )
    known = (
        ", ".join(label for label in stream.labels if label)
        or "no labels; give indices, as in SOL=0"
    )
    raise StreamRefused(
        f"{stream.title} has no channel '{channel}' for {muscle}; its {count} channels have {known}"
    )


def _to_volts(stream: StreamDescription, muscle: str, number: int, unit: str) -> float:
    declared = unit or stream.units[number]
    if not declared:
        raise StreamRefused(
            f"{stream.title} declares no unit for channel {number} ({muscle}); state it with the "
            "parameter 'unit'"
        )
    if declared.strip().lower() not in VOLTS:
        raise StreamRefused(
            f"{stream.title}: channel {number} ({muscle}) is in '{declared}'; expected V, mV, uV "
            "or nV"
        )
    return VOLTS[declared.strip().lower()]
