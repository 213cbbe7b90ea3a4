"""The people of a scene: one filter, one memory, one decision which of them is which."""
