"""A virtual rig and subject that share no physics code with the software under test, and the sealed
cases made with them.

Nothing here imports `ankle_physics`, `model_discrepancy` or `ankle_sim`: what the diagnosis
recovers, it recovers from a recording.
"""
