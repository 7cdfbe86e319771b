"""Effects that a recording may hide, each with its equation and its strength."""
