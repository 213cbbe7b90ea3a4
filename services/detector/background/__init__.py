"""Foreground against a background that is learned pixel by pixel."""
