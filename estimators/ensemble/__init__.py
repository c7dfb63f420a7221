"""What observers share that run several twins."""
