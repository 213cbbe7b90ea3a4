"""Following real people with a virtual pan: the loop closes over a recording's own pixels."""
