"""Devices without the hardware: programs that speak the true protocols, for tests and for those who have none."""
