"""Settings of the estimators: every number with its unit, allowed range and reason."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields
from typing import Any

HIGHPASS_CHOICES = ("torque", "all")


def number(default: float, unit: str, lower: float, upper: float, reason: str) -> Any:
    """A field that holds a number within a range."""
    return field(
        default=default, metadata={"unit": unit, "lower": lower, "upper": upper, "reason": reason}
    )


def choice(default: str, choices: tuple[str, ...], reason: str) -> Any:
    """A field that holds one of a few words."""
    return field(default=default, metadata={"unit": "", "choices": choices, "reason": reason})


@dataclass(frozen=True)
class EstimatorSettings:
    """What every estimator can be told.

    Raises
    ------
    ValueError
        A value out of its range, with name, value, unit and range.
    """

    settling_time: float = number(
        30.0,
        "s",
        1.0,
        300.0,
        "Time with data before estimates are valid. Paper, III-A: the first 30 s are ignored.",
    )
    estimate_rate: float = number(
        64.0, "Hz", 1.0, 500.0, "Estimates per second, at fixed sample counts."
    )

    def __post_init__(self) -> None:
        for name, entry in describe(type(self)).items():
            value = getattr(self, name)
            choices = entry.metadata.get("choices")
            if choices is not None:
                if value not in choices:
                    raise ValueError(
                        f"setting '{name}' = {value!r} is refused; allowed: one of "
                        f"{', '.join(choices)}"
                    )
                continue
            lower, upper, unit = (
                entry.metadata["lower"],
                entry.metadata["upper"],
                entry.metadata["unit"],
            )
            if not (isinstance(value, (int, float)) and lower <= value <= upper):
                unit = "" if unit == "1" else f" {unit}"
                raise ValueError(
                    f"setting '{name}' = {value!r}{unit} is refused; allowed: {lower:g} to "
                    f"{upper:g}{unit}"
                )


@dataclass(frozen=True)
class Settings(EstimatorSettings):
    """Numbers of the algorithms O, C and CE; `describe` gives unit, range and reason of each.

    Raises
    ------
    ValueError
        A value out of its range, with name, value, unit and range.
    """

    highpass: str = choice(
        "torque",
        HIGHPASS_CHOICES,
        "Signals that pass the high-pass: 'torque' is the paper's (torque and rectified velocity; "
        "K comes out about 5 % low), "
        "'all' treats position, velocity and acceleration alike (unbiased).",
    )
    highpass_cutoff: float = number(
        0.033, "Hz", 0.001, 3.0, "Removes voluntary torque. Paper, II-A."
    )
    lowpass_cutoff: float = number(
        100.0, "Hz", 30.0, 200.0, "Low-pass on all inputs (C and CE). Paper, II-D."
    )
    intrinsic_average_cutoff: float = number(
        0.025,
        "Hz",
        0.005,
        1.0,
        "Averaging low-pass of the intrinsic products; gives the paper's rise time of about 16 s.",
    )
    reflex_average_cutoff: float = number(
        0.04,
        "Hz",
        0.005,
        1.0,
        "Averaging low-pass of the reflex correlations; gives the paper's rise time of about 8 s.",
    )
    reflex_first_lag: float = number(
        0.040,
        "s",
        0.02,
        0.1,
        "Start of the reflex response: shortest stretch-reflex delay. Paper, II-A.",
    )
    reflex_last_lag: float = number(
        0.400, "s", 0.15, 0.45, "End of the reflex response. Paper, II-A."
    )
    reflex_ridge: float = number(
        1e-3,
        "1",
        1e-9,
        0.1,
        "Added to the diagonal of the reflex system, relative to it: lags that the perturbation "
        "hardly excites then amplify no noise.",
    )
    operating_point_time: float = number(
        60.0,
        "s",
        5.0,
        1000.0,
        "With highpass 'torque', position counts from its mean over this time: one hold period of "
        "the paper, ten memories of the averages.",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.reflex_last_lag <= self.reflex_first_lag:
            raise ValueError(
                f"reflex_last_lag = {self.reflex_last_lag:g} s must be after reflex_first_lag = "
                f"{self.reflex_first_lag:g} s"
            )


def describe(settings: type[EstimatorSettings]) -> Mapping[str, Field]:
    """The fields of a settings class by name; ``metadata`` has unit, reason and range or choices."""  # noqa: E501
    return {entry.name: entry for entry in fields(settings)}
