"""Parameters of the node: the algorithm, and the settings of all algorithms with the units and
ranges that they declare.
"""

from __future__ import annotations

from ankle_interfaces.quantity import Quantity, Value, quantities
from impedance_estimator.algorithms import ALGORITHMS, DEFAULT
from impedance_estimator.settings import EstimatorSettings

_TITLES = "; ".join(f"{name}: {estimator.title}" for name, estimator in ALGORITHMS.items())

_settings: dict[str, Quantity] = {}
for _estimator in (ALGORITHMS[DEFAULT], *ALGORITHMS.values()):
    for _name, _entry in quantities(_estimator.settings_type).items():
        _settings.setdefault(_name, _entry)


WAIT_FOR_READERS = Quantity(
    "wait_for_readers",
    "1",
    0,
    100,
    0,
    description=(
        "Samples are taken in once so many nodes read /impedance/estimate: none of its rows is "
        "missed."
    ),
    start_only=True,
)

MODEL = Quantity(
    "model",
    default="",
    description=(
        "The subject's model (a YAML file, as ankle diagnose writes it); its terms run beside the "
        "regression. Empty: none."
    ),
)
TERMS = Quantity(
    "terms",
    default="",
    description="Folder of terms of one's own (Python) that the model may hold; empty: none.",
    start_only=True,
)
RIG = Quantity(
    "rig",
    default="",
    description="The calibrated rig (rig.yaml): what lies between joint and sensors. Empty: none.",
)

PARAMETERS = (
    WAIT_FOR_READERS,
    MODEL,
    TERMS,
    RIG,
    Quantity(
        "algorithm",
        default=DEFAULT,
        description=(
            f"Estimator; another one settles beside the present one and takes over. {_TITLES}."
        ),
        choices=tuple(ALGORITHMS),
    ),
    *_settings.values(),
)


def settings_from(values: dict[str, Value]) -> EstimatorSettings:
    """Return settings of the algorithm that `values` names, from parameter values by name.

    Parameters at their declared default are left to the algorithm, whose own default may differ; so
    a node with untouched parameters gives what the algorithm gives from a file.

    Raises
    ------
    QuantityError
        Values that do not fit each other.
    """
    settings_type = ALGORITHMS[str(values["algorithm"])].settings_type
    own = quantities(settings_type)
    return settings_type(
        **{  # type: ignore[arg-type]
            name: value
            for name, value in values.items()
            if name in own and value != _settings[name].default
        }
    )  # type: ignore[arg-type]
