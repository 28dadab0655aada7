"""The processes of a farm, which write bags."""
