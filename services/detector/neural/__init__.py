"""People by a neural network that OpenCV runs on the processor."""
