"""The default estimator: intrinsic and reflex parameters in one regression."""
