"""Motion command in, wheels out: the robot's end, which stops by itself when commands stop."""
