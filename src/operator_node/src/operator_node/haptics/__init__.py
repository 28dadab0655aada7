"""Force feedback that cannot hurt: haptic devices, and the loop at 1 kHz between them and a tool."""
