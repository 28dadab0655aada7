"""What the simulator publishes of every tick."""
