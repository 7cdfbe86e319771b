"""Pulse-step and other perturbation signals for joint identification."""
