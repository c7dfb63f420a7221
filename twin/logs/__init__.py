"""Drives and recorded logs: file formats, maps, units."""
