"""Settings of the estimators: every number with its unit, allowed range and reason."""

from __future__ import annotations

from dataclasses import dataclass

from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import check_settings, choice, number

HIGHPASS_CHOICES = ("torque", "all")


@dataclass(frozen=True)
class EstimatorSettings:
    """Holds the settings that every estimator has.

    Raises
    ------
    QuantityError
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
        64.0,
        "Hz",
        1.0,
        500.0,
        "It is the number of estimates in each second. They come at fixed sample counts.",
    )

    def __post_init__(self) -> None:
        check_settings(self)


@dataclass(frozen=True)
class Settings(EstimatorSettings):
    """Holds numbers of the algorithms O, C and CE.

    Raises
    ------
    QuantityError
        A value out of its range, with name, value, unit and range.
    """

    highpass: str = choice(
        "torque",
        HIGHPASS_CHOICES,
        "It names the signals that pass the high-pass: 'torque' is the paper's (torque and "
        "rectified velocity; K comes out about 5 % low), "
        "'all' treats position, velocity and acceleration alike (unbiased).",
    )
    highpass_cutoff: float = number(
        0.033,
        "Hz",
        0.001,
        3.0,
        "It is the cut-off of the high-pass, which removes voluntary torque (paper, II-A).",
    )
    lowpass_cutoff: float = number(
        100.0,
        "Hz",
        30.0,
        200.0,
        "It is the cut-off of the low-pass on all inputs of C and CE (paper, II-D).",
    )
    intrinsic_average_cutoff: float = number(
        0.025,
        "Hz",
        0.005,
        1.0,
        "It is the cut-off of the average of the intrinsic products. It gives the paper's rise "
        "time of about 16 s.",
    )
    reflex_average_cutoff: float = number(
        0.04,
        "Hz",
        0.005,
        1.0,
        "It is the cut-off of the average of the reflex correlations. It gives the paper's rise "
        "time of about 8 s.",
    )
    reflex_first_lag: float = number(
        0.040,
        "s",
        0.02,
        0.1,
        "It is the start of the reflex response, the shortest stretch-reflex delay (paper, II-A).",
    )
    reflex_last_lag: float = number(
        0.400,
        "s",
        0.15,
        0.45,
        "It is the end of the reflex response (paper, II-A).",
    )
    reflex_ridge: float = number(
        1e-3,
        "1",
        1e-9,
        0.1,
        "It is added to the diagonal of the reflex system, relative to it. Lags that the "
        "perturbation hardly excites then amplify no noise.",
    )
    operating_point_time: float = number(
        60.0,
        "s",
        5.0,
        1000.0,
        "With highpass 'torque', position is counted from its mean over this time: one hold "
        "period of the paper, ten memories of the averages.",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.reflex_last_lag <= self.reflex_first_lag:
            raise QuantityError(
                f"reflex_last_lag = {self.reflex_last_lag:g} s must be after reflex_first_lag = "
                f"{self.reflex_first_lag:g} s"
            )
