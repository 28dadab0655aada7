"""Topics, services and actions of robots beside their samples."""
