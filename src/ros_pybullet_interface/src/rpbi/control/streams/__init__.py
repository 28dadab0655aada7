"""Streams of joint targets: their playout delay, and the motion between targets."""
