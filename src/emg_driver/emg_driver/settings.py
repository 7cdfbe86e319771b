"""Parameters of the EMG processing, as data; the pure modules and the node read the same list."""

from __future__ import annotations

from dataclasses import dataclass

from ankle_node.parameters import Parameter, ParameterError, Value

ONSET_SOURCES = ("auto", "reference", "velocity")

PROCESSING = (
    Parameter(
        "highpass_cutoff",
        20.0,
        "Hz",
        "High-pass before rectification (paper, section III-B.3).",
        1.0,
        200.0,
    ),
    Parameter(
        "highpass_order",
        2,
        "1",
        "Order of that Butterworth filter; the paper gives none, 2 is what amplifiers have.",
        1,
        8,
    ),
    Parameter(
        "background_window",
        0.040,
        "s",
        "Background: mean over so long before an onset (paper, figure 4).",
        0.005,
        0.2,
    ),
    Parameter(
        "reflex_start",
        0.040,
        "s",
        "Start of the reflex window after the onset (paper, figure 4).",
        0.0,
        0.2,
    ),
    Parameter(
        "reflex_end",
        0.060,
        "s",
        "End of the reflex window after the onset (paper, figure 4).",
        0.005,
        0.4,
    ),
    Parameter(
        "onset_source",
        "auto",
        "",
        "Where onsets come from; auto: the reference, and velocity while there is none.",
        choices=ONSET_SOURCES,
    ),
    Parameter(
        "onset_velocity",
        0.3,
        "rad/s",
        "Speed that a movement must reach: a tenth of the paper's perturbation (3 rad/s), more "
        "than a servo's overshoot.",
        0.01,
        20.0,
    ),
    Parameter(
        "rest_velocity",
        0.05,
        "rad/s",
        "Measured speed that counts as rest: seven times the noise of the paper's velocity sensor.",
        1e-4,
        5.0,
    ),
    Parameter(
        "ensemble_size",
        100,
        "1",
        "Onsets in the running ensemble average (the paper's holds have about 100).",
        2,
        10_000,
    ),
    Parameter("ensemble_before", 0.100, "s", "Ensemble average: start before the onset.", 0.0, 0.5),
    Parameter("ensemble_after", 0.200, "s", "Ensemble average: end after the onset.", 0.01, 0.5),
)

ELECTRODES = (
    Parameter("mains_frequency", 50.0, "Hz", "Of the local power line.", 45.0, 65.0),
    Parameter(
        "hum_share",
        0.3,
        "1",
        "Largest share of mains hum in a channel's power from 20 to 450 Hz; above it the "
        "electrode is bad.",
        0.01,
        1.0,
    ),
    Parameter(
        "flat_range",
        1e-7,
        "V",
        "A channel that varies less than this for 25 ms is flat; amplifiers have at least 0.3 uV "
        "of noise.",
        0.0,
        1e-3,
    ),
    Parameter(
        "largest_rms",
        2e-3,
        "V",
        "Largest rms that skin electrodes give; maximal contractions of the calf stay below 1 mV. "
        "Above: wrong unit or loose electrode.",
        1e-5,
        1.0,
    ),
)


@dataclass(frozen=True)
class ElectrodeSettings:
    """Limits for a good electrode; each is described in `ELECTRODES`.

    Raises
    ------
    ParameterError
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
    """Numbers of the processing; each is described in `PROCESSING`.

    Raises
    ------
    ParameterError
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
            raise ParameterError(
                f"parameter 'reflex_end' = {self.reflex_end:g} s is refused; allowed: after "
                f"'reflex_start' = {self.reflex_start:g} s"
            )
        if self.rest_velocity >= self.onset_velocity:
            raise ParameterError(
                f"parameter 'rest_velocity' = {self.rest_velocity:g} rad/s is refused; "
                f"allowed: below 'onset_velocity' = {self.onset_velocity:g} rad/s"
            )


def electrodes_from(values: dict[str, Value]) -> ElectrodeSettings:
    """Electrode limits from parameter values by name; others are ignored."""
    return ElectrodeSettings(**{parameter.name: values[parameter.name] for parameter in ELECTRODES})  # type: ignore[arg-type]


def settings_from(values: dict[str, Value]) -> Settings:
    """Settings from the value of every parameter in `PROCESSING` and `ELECTRODES`, by name; others
    are ignored.
    """
    own = {parameter.name: values[parameter.name] for parameter in PROCESSING}
    return Settings(**own, electrodes=electrodes_from(values))  # type: ignore[arg-type]
