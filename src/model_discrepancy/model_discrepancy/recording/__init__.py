"""A recording, its channels, and whether it can be used."""
