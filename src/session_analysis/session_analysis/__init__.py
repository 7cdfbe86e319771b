"""Hold periods of recorded sessions: impedance estimates against EMG, with confidence intervals,
pictures and a report.
"""
