"""Publishers of the simulator."""
