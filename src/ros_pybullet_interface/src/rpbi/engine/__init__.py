"""Parts that run a world: clock, pacer, mailbox, inputs."""
