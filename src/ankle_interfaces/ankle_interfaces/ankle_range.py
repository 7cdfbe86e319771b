"""How far an ankle goes."""

PASSIVE_RANGE = 0.35
"""[rad] End of the ankle's passive range in dorsiflexion: 20 degrees. No setting goes beyond it."""
