"""Parameters of bridge and processing, as data that the pure modules and the nodes read."""

from __future__ import annotations

from dataclasses import dataclass

from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Quantity, Value

ONSET_SOURCES = ("auto", "reference", "velocity")

PROCESSING = (
    Quantity(
        "highpass_cutoff",
        "Hz",
        1.0,
        200.0,
        20.0,
        description="High-pass before rectification (paper, section III-B.3).",
    ),
    Quantity(
        "highpass_order",
        "1",
        1,
        8,
        2,
        description=(
            "Order of that Butterworth filter; the paper gives none, 2 is what amplifiers have."
        ),
    ),
    Quantity(
        "background_window",
        "s",
        0.005,
        0.2,
        0.040,
        description="Background: mean over so long before an onset (paper, figure 4).",
    ),
    Quantity(
        "reflex_start",
        "s",
        0.0,
        0.2,
        0.040,
        description="Start of the reflex window after the onset (paper, figure 4).",
    ),
    Quantity(
        "reflex_end",
        "s",
        0.005,
        0.4,
        0.060,
        description="End of the reflex window after the onset (paper, figure 4).",
    ),
    Quantity(
        "onset_source",
        default="auto",
        description=(
            "Source of the onsets; auto: commanded ones at the time when the plate moved, and "
            "measured velocity alone while there is no command."
        ),
        choices=ONSET_SOURCES,
    ),
    Quantity(
        "onset_velocity",
        "rad/s",
        0.01,
        20.0,
        0.3,
        description=(
            "Speed that a movement must reach: a tenth of the paper's perturbation (3 rad/s), more "
            "than a servo's overshoot."
        ),
    ),
    Quantity(
        "rest_velocity",
        "rad/s",
        1e-4,
        5.0,
        0.05,
        description=(
            "Measured speed that counts as rest: seven times the noise of the paper's velocity "
            "sensor."
        ),
    ),
    Quantity(
        "ensemble_size",
        "1",
        2,
        10_000,
        100,
        description="Onsets in the running ensemble average (the paper's holds have about 100).",
    ),
    Quantity(
        "ensemble_before",
        "s",
        0.0,
        0.5,
        0.100,
        description="Ensemble average: start before the onset.",
    ),
    Quantity(
        "ensemble_after",
        "s",
        0.01,
        0.5,
        0.200,
        description="Ensemble average: end after the onset.",
    ),
)

ELECTRODES = (
    Quantity(
        "mains_frequency", "Hz", 45.0, 65.0, 50.0, description="Frequency of the local power line."
    ),
    Quantity(
        "hum_share",
        "1",
        0.01,
        1.0,
        0.3,
        description=(
            "Largest share of mains hum in a channel's power from 20 to 450 Hz; above it the "
            "electrode is bad."
        ),
    ),
    Quantity(
        "flat_range",
        "V",
        0.0,
        1e-3,
        1e-7,
        description=(
            "A channel that varies less than this for 25 ms is flat; amplifiers have at least "
            "0.3 uV "
            "of noise."
        ),
    ),
    Quantity(
        "largest_rms",
        "V",
        1e-5,
        1.0,
        2e-3,
        description=(
            "Largest rms that skin electrodes give; maximal contractions of the calf stay below "
            "1 mV. "
            "Above: wrong unit or loose electrode."
        ),
    ),
)


BRIDGE = (
    Quantity(
        "stream_name", default="", description="Name of the stream; empty: any.", start_only=True
    ),
    Quantity(
        "stream_type", default="EMG", description="Type of the stream; empty: any.", start_only=True
    ),
    Quantity(
        "stream_source_id",
        default="",
        description="Source id of the stream; empty: any.",
        start_only=True,
    ),
    Quantity(
        "channels",
        default="SOL=SOL,TA=TA,GL=GL,GM=GM",
        description="Channel of each muscle: MUSCLE=label or MUSCLE=index, counted from 0.",
        start_only=True,
    ),
    Quantity(
        "unit",
        default="",
        description="Unit of the channels (V, mV, uV, nV); empty: as the stream declares.",
        start_only=True,
    ),
    Quantity(
        "rate",
        "Hz",
        0.0,
        20_000.0,
        0.0,
        description="Sampling rate that the stream must have; 0: any that suits EMG.",
        start_only=True,
    ),
    Quantity(
        "silence",
        "s",
        0.1,
        10.0,
        0.5,
        description="A stream without samples for so long counts as stopped.",
    ),
    *ELECTRODES,
    Quantity(
        "wait_for_readers",
        "1",
        0,
        100,
        0,
        description="Readers of /emg/samples to wait for before the stream is read.",
        start_only=True,
    ),
)
"""Parameters of the bridge from a stream to the topic."""


@dataclass(frozen=True)
class ElectrodeSettings:
    """Holds limits for a good electrode; each is described in `ELECTRODES`.

    Raises
    ------
    QuantityError
        A value out of range.
    """

    mains_frequency: float = 50.0
    hum_share: float = 0.3
    flat_range: float = 1e-7
    largest_rms: float = 2e-3

    def __post_init__(self) -> None:
        for parameter in ELECTRODES:
            parameter.check(getattr(self, parameter.name))


@dataclass(frozen=True)
class Settings:
    """Holds numbers of the processing; each is described in `PROCESSING`.

    Raises
    ------
    QuantityError
        A value out of range, or a reflex window that ends before it starts.
    """

    highpass_cutoff: float = 20.0
    highpass_order: int = 2
    background_window: float = 0.040
    reflex_start: float = 0.040
    reflex_end: float = 0.060
    onset_source: str = "auto"
    onset_velocity: float = 0.3
    rest_velocity: float = 0.05
    ensemble_size: int = 100
    ensemble_before: float = 0.100
    ensemble_after: float = 0.200
    electrodes: ElectrodeSettings = ElectrodeSettings()

    def __post_init__(self) -> None:
        for parameter in PROCESSING:
            parameter.check(getattr(self, parameter.name))
        if self.reflex_end <= self.reflex_start:
            raise QuantityError(
                f"parameter 'reflex_end' = {self.reflex_end:g} s is refused; allowed: after "
                f"'reflex_start' = {self.reflex_start:g} s"
            )
        if self.rest_velocity >= self.onset_velocity:
            raise QuantityError(
                f"parameter 'rest_velocity' = {self.rest_velocity:g} rad/s is refused; "
                f"allowed: below 'onset_velocity' = {self.onset_velocity:g} rad/s"
            )


def electrodes_from(values: dict[str, Value]) -> ElectrodeSettings:
    """Return electrode limits from parameter values by name; others are ignored."""
    return ElectrodeSettings(**{parameter.name: values[parameter.name] for parameter in ELECTRODES})  # type: ignore[arg-type]


def settings_from(values: dict[str, Value]) -> Settings:
    """Return settings from the values of `PROCESSING` and `ELECTRODES`, by name.

    Other parameters are ignored.
    """
    own = {parameter.name: values[parameter.name] for parameter in PROCESSING}
    return Settings(**own, electrodes=electrodes_from(values))  # type: ignore[arg-type]
