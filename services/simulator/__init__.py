"""A world with people, and a robot whose camera moves when it is told to."""
