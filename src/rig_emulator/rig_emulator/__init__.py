"""A simulated rig at the other end of the driver's line, with a clock of its own and faults on
request.
"""
