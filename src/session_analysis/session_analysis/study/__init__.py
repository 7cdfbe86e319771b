"""A study: subjects, visits, runs; where each recording lies, what is known about it, its results
and how well they repeat.
"""
