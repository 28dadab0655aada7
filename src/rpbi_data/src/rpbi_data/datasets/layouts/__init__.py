"""Files and names of the formats, which writers and checks share."""
