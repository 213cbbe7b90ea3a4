"""Two hosts and a link between them, for what Heel does across a network."""
