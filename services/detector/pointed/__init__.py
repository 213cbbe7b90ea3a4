"""Somebody a user pointed at, kept by the colours of their clothes: no background, no network."""
