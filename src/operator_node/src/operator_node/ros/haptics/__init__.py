"""The haptic node, and devices that communicate by topics."""
