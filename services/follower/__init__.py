"""Tracks in, motion command out: one chosen person, and zero velocity whenever in doubt."""
