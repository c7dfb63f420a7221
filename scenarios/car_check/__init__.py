"""`til check-car`: draws, measures and drives a car, and compares it with usual cars."""
