"""Following trajectories of joints."""
