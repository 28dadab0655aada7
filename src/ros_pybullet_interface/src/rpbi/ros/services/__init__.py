"""Services of the node and of each body."""
