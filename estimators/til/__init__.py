"""The Twin-in-the-Loop observer: laws, gains, validation of measurements, streaming."""
