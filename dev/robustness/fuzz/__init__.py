"""Hostile targets for the guard, and an oracle that judges what comes of them."""
