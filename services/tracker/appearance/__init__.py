"""Appearance of people: descriptor, gallery, and a metric learned from the scene."""
