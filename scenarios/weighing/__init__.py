"""Weighing a car from recorded trips: logs, calibration files, tables and pictures."""
