"""Calibration measures the rig (``rig.yaml``) and the session (``subject.yaml``) once."""
