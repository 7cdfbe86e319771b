"""The colours of lines and points in every figure and on every page."""

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
"""Okabe & Ito: told apart by colour-blind readers."""
