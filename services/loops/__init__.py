"""The cores in a closed loop with what they see: simulated worlds, and windows of recordings."""
