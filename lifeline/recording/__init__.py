"""`lifeline record`: record all messages in MCAP files, and read them again."""
