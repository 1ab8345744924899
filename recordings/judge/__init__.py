"""Judges a recording of any robot: where Lifeline would have stopped it, and whether past-time rules held."""
