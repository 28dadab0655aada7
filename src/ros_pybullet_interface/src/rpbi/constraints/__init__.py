"""What holds bodies and joints together beside contact: attachments, and joints that follow others."""
