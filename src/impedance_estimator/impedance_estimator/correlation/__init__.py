"""The estimators of the paper (O, C and CE): intrinsic and reflex torque separated one after the
other.
"""
