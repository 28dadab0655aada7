"""Worlds as environments of Gymnasium: tasks, their spaces, random variation, and many worlds at once.

This package needs the extra `gym`; see docs/gym.md.
"""
