"""Gymnasium environments of worlds: tasks, their spaces, random variation, and vectors of environments.

This package needs the extra `gym`; see docs/gym.md.
"""
