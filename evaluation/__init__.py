"""Offline scoring of recorded tracks against ground truth: no Zenoh, no camera, no clock."""
