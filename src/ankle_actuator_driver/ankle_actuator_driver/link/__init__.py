"""How the driver reaches a rig: packets, clocks and transports."""
