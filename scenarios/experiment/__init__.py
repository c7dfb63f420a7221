"""Experiments: what is driven, what is estimated, and how it is scored."""
