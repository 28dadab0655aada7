"""Nodes of `lfd.launch`: learning from demonstration, and the scripted person."""
