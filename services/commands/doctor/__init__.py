"""`heel doctor`: what keeps a robot from working, the cause, and the next command."""
