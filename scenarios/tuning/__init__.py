"""Gains chosen from data."""
