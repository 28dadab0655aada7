"""Hostile bags by a seed: their makers by subject, and the trial of a reader."""
