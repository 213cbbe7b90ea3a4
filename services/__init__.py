"""The processes of Heel, and the command that runs them."""
