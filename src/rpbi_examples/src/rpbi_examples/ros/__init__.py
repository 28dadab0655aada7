"""The example nodes."""
