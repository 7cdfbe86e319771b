"""The option `--at-most` of the verbs that diagnose."""

from __future__ import annotations

from typing import Annotated

from ankle_bringup.terminal import number_option
from model_discrepancy.search.time_limit import AT_MOST

DEFAULT_MINUTES = float(AT_MOST.default)
AtMost = Annotated[
    float | None,
    number_option(
        AT_MOST,
        "Time [min] after which the diagnosis adds no further terms; "
        f"{AT_MOST.default:g} where nothing is stated.",
    ),
]
