"""Record, replay, import and export of bags."""
