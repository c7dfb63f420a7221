"""The observer on a CAN bus."""
