"""What makes a world run: its clock, the pace, what comes in and what is logged."""
