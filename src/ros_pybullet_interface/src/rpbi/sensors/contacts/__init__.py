"""Where bodies touch each other: as it is, as means, and as arrows."""
