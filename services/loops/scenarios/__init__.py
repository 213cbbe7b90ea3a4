"""The stack's own cores in a closed loop with a simulated world; alone here services are known."""
