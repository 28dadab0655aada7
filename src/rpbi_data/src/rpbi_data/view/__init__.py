"""An episode as one HTML page: its world in 3-D, forces as arrows, and plots of the forces."""
