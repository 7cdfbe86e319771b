"""The bridge between the graph and a rig's own real-time controller, and an emulator of that
controller.
"""
