"""What a fitted model leaves unexplained: where it is, and how much of it a movement still
predicts.
"""
