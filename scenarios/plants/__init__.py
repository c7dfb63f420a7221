"""Real vehicles: what the twin does not know of."""
