"""Hostile files by structure and by bytes, what reads them, and what becomes of that."""
