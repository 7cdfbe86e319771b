"""The bridge between the graph and a rig's own real-time controller."""
