"""The packets of docs/rig_protocol.md: their bytes, both clocks, and who sends them when."""
