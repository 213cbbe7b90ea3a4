"""OpenCV's MOG2 with the paper's true-blob test: the preset `paper`, and a rival to measure by."""
