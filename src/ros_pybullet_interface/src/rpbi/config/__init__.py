"""YAML files: reading, and models of their keys."""
