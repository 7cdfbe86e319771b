"""Fits of a list of terms to a recording, and their score on data that was not used for fitting."""
