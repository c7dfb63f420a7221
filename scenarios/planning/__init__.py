"""What to drive so that a parameter becomes known: manoeuvres designed by their information."""
