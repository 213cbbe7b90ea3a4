"""Runs: a source or a simulated world through the real processes, or the same cores in this one."""
