"""What YAML says: files, models of their keys, and what they mean."""
