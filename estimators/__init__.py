"""Observers that correct a black-box twin, and what tunes and scores them."""
