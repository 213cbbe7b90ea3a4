"""`heel report`: a run or a recording as one page: read, told as facts, drawn."""
