"""What stands in for devices that one does not have, by the protocols of the true ones."""
