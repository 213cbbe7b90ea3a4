"""Speed, latency and memory: always against something, medians of interleaved runs."""
