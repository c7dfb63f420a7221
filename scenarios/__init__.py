"""Drives: manoeuvres, real vehicles, the experiments of the papers, the command line."""
