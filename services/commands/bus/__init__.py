"""Tools that look at what passes on the bus: `heel topics`, `hz`, `bw`, `echo`."""
