"""Nodes of `lfd.launch`: the lesson, and the scripted person."""
