"""The robot under test: the whole stack, fault injection for each part of it, and the observer."""
