"""Torques that the foot takes to be moved, each with its numbers and its compiled equation."""
