"""What keeps the person safe: limits, states, stop and supervision.

It knows neither packets nor sockets.
"""
