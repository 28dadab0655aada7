"""Episodes of a farm as bags, and the processes that write them."""
