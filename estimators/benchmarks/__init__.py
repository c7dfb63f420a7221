"""Model-based estimators that the twin is measured against."""
