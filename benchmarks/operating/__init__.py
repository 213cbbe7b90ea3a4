"""A robot that is operated: its units as systemd runs them, and an eye on its world."""
