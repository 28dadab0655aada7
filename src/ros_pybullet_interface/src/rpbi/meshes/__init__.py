"""Mesh files: what is wrong with them, and trying them where nothing can break."""
