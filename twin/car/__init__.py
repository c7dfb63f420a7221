"""A car as its files describe it: MJCF, TOML, loads."""
