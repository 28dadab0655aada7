"""Bags: their files, the layout of their messages, tables of them, and limits for hostile ones."""
