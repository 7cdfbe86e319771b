"""These modules examine what a fitted model leaves unexplained.

They find where it is, and how much of it a movement still predicts.
"""
