"""The containers as a user starts them, on a real engine."""
