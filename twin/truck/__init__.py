"""The truck of KBF."""
