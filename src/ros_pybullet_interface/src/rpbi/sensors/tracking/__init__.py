"""Sensors that report where bodies are as tracking systems of a laboratory do, with what these do not do well."""
