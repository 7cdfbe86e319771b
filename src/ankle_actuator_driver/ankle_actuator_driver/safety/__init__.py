"""What keeps the subject safe: limits, states, stop and supervision.

It knows neither packets nor sockets.
"""
