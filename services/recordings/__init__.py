"""Recordings of the bus as MCAP files: what a message becomes in one, and how it is read again."""
