"""Recorded logs: inspected and observed."""
