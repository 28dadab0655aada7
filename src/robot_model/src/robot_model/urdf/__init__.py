"""URDFs: reading, structural checks, referenced files, and modified copies."""
