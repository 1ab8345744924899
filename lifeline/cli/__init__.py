"""The options of every command, grouped by what a user wants. An implementation is imported only when its command runs."""
