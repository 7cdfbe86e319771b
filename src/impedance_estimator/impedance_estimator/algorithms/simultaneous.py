"""The default estimator: one regression for the intrinsic and the reflex part together.

``docs/estimators.md`` derives it; its parts are in `impedance_estimator.simultaneous`.
"""

from impedance_estimator.simultaneous.simultaneous_estimator import Simultaneous

Algorithm = Simultaneous
