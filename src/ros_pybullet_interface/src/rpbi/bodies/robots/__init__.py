"""Bodies with joints that are driven."""
