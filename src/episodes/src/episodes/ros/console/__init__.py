"""Commands for folders of episodes."""
