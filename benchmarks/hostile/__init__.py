"""Messages of somebody on the bus who means ill, for `benchmarks.hostile_messages`."""
