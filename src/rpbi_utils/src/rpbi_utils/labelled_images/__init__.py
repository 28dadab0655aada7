"""Former names of `rpbi_data.labels`."""
