"""Force feedback within safe limits: haptic devices, and the 1 kHz loop between them and a tool."""
