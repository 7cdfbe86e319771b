"""Online separation of intrinsic and reflexive joint impedance."""
