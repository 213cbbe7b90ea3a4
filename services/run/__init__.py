"""`heel run`: one source through the real processes, or the same cores in this one; files out."""
