"""Co-simulation FMUs in the twin's place."""
