"""What passed on the bus, kept: in files all the time, or in memory until something happens."""
