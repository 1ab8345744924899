"""The commands `topic`, `node`, `graph` and `doctor`: who takes part, what they send, and what is wrong."""
