"""How well one person was followed: other benchmarks' measures, from an episode's log."""
