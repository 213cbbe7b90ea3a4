"""The page for people: the live picture with its tracks, the choice of a target, and STOP."""
