"""Measurements from given boxes: of a detector, or of a MOTChallenge det.txt."""
