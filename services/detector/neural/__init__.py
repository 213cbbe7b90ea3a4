"""People by a neural network."""
