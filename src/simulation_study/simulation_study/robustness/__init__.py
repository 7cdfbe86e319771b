"""Estimators are compared on an independent rig, with each effect that a laboratory may meet."""
