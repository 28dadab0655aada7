"""Contact points between bodies: of one tick, as means, and as arrows."""
