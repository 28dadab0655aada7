"""The haptic node, and devices that are spoken to by topics."""
