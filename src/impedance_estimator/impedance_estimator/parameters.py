"""Parameters of the node: the algorithm, and the settings of all algorithms with the units and
ranges that they declare.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import Field
from typing import Any

from ankle_node.parameters import Parameter, Value
from impedance_estimator.algorithms import ALGORITHMS, DEFAULT
from impedance_estimator.settings import EstimatorSettings, describe

_TITLES = "; ".join(f"{name}: {estimator.title}" for name, estimator in ALGORITHMS.items())

_fields: dict[str, Field] = {}
for _estimator in (ALGORITHMS[DEFAULT], *ALGORITHMS.values()):
    for _name, _entry in describe(_estimator.settings_type).items():
        _fields.setdefault(_name, _entry)


def _parameter(name: str, default: Any, metadata: Mapping[str, Any]) -> Parameter:
    return Parameter(
        name,
        default,
        metadata["unit"],
        metadata["reason"],
        metadata.get("lower", -math.inf),
        metadata.get("upper", math.inf),
        metadata.get("choices", ()),
    )


WAIT_FOR_READERS = Parameter(
    "wait_for_readers",
    0,
    "1",
    "Samples are taken in once so many nodes read /impedance/estimate: none of its rows is missed.",
    0,
    100,
    fixed=True,
)

PARAMETERS = (
    WAIT_FOR_READERS,
    Parameter(
        "algorithm",
        DEFAULT,
        "",
        f"Estimator; a change starts it anew. {_TITLES}.",
        choices=tuple(ALGORITHMS),
    ),
    *(_parameter(name, entry.default, entry.metadata) for name, entry in _fields.items()),
)


def settings_from(values: dict[str, Value]) -> EstimatorSettings:
    """Settings of the algorithm that `values` names, from parameter values by name.

    Parameters at their declared default are left to the algorithm, whose own default may differ; so
    a node with untouched parameters gives what the algorithm gives from a file.

    Raises
    ------
    ValueError
        Values that do not fit each other.
    """
    settings_type = ALGORITHMS[str(values["algorithm"])].settings_type
    own = describe(settings_type)
    return settings_type(
        **{  # type: ignore[arg-type]
            name: value
            for name, value in values.items()
            if name in own and value != _fields[name].default
        }
    )  # type: ignore[arg-type]
