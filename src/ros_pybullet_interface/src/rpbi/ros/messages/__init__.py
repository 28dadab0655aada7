"""Messages of topics, made from samples and read."""
