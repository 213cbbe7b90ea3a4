"""A world with people, and a robot with a camera that moves when it is told to."""
