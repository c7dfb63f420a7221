"""Drivers, paths, manoeuvres and their recording."""
