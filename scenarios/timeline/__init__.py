"""Timelines for the Rerun viewer."""
