"""Commands for bags, episodes and data sets."""
