"""Former names of `rpbi_data.datasets`."""
