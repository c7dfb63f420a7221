"""Twins fitted to logs."""
