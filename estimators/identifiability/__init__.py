"""What a drive can tell of a car at all: bounds, and words for them."""
