"""A window with buttons for a running simulator."""
